// SPDX-License-Identifier: Apache-2.0
#include "base/toml_reader.h"

#include <gtest/gtest.h>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

TEST(TomlReader, ReadsWhatIsThereAndLeavesDefaults) {
  TomlReader toml =
      TomlReader::parse("rate_hz = 60\nname = \"x\"\nup = [0, 1, 0]\n[light]\nlux = 2.5\n", "t")
          .value();
  double rate_hz = 1;
  int frames = 120;
  std::string name;
  Eigen::Vector3d up;
  toml.require("rate_hz", rate_hz);
  toml.read("frames", frames);
  toml.read("name", name);
  toml.read("up", up);
  double lux = 0;
  toml.table("light").require("lux", lux);
  ASSERT_TRUE(toml.finish()) << toml.finish().error().what;
  EXPECT_EQ(rate_hz, 60);
  EXPECT_EQ(frames, 120);
  EXPECT_EQ(name, "x");
  EXPECT_EQ(up, Eigen::Vector3d::UnitY());
  EXPECT_EQ(lux, 2.5);
}

TEST(TomlReader, LettersBeyondAsciiStandInQuotesAndComments) {
  for (const char* good : {"name = \"T\u00fcr\"  # T\u00fcr\n",
                           "\xEF\xBB\xBFname = 'T\u00fcr'\n",
                           "name = \"\"\"a \"\u00fc\" \\\" \u00fc\"\"\"\"\n",
                           "name = \'\'\'\u00fc\n\'\'\u00fc\'\'\'\'\'\n# \u00fc",
                           "\"name\" = \"\\\"\u00fc\"\n"}) {
    auto toml = TomlReader::parse(good, "t");
    ASSERT_TRUE(toml) << good << toml.error().what;
    std::string name;
    toml->read("name", name);
    EXPECT_NE(name.find("\u00fc"), std::string::npos) << good;
    EXPECT_TRUE(toml->finish()) << good;
  }
  // Most of these once ran into what toml++ takes to be impossible.
  for (const char* wrong : {"a = 1\nna\u00efve = 1\n",
                            "a = 1\nb = \u00fc\n",
                            "a = 1\nb = -\"\u00fc\"\n",
                            "a = 1\nw\u03fb = 2\n",
                            "a = '1'\n\u00a0b = 2\n",
                            "a = \"\"\"1\"\"\"\n\u3000",
                            "# \u00fc\n\xff"}) {
    const auto toml = TomlReader::parse(wrong, "t");
    ASSERT_FALSE(toml) << wrong;
    EXPECT_EQ(toml.error().code, Errc::kInvalidOption);
    EXPECT_NE(toml.error().what.find("t:2: a character that is not ASCII"), std::string::npos)
        << toml.error().what;
  }
}

// Each once ran into what toml++ takes to be impossible.
TEST(TomlReader, RefusesATableWithoutAName) {
  for (const char* wrong : {"a = [\n [1]]\n[\x01b]\n",
                            "a = [[1], # [\n  [2]]\n[!b]\n",
                            "a = 1\nb = ']'\n  [ =]\n",
                            "# [\n'a]' = 1\n[[.b]]\n",
                            "\n\n[\nb]\n",
                            "\n\n[[ [b]]\n"}) {
    const auto toml = TomlReader::parse(wrong, "t");
    ASSERT_FALSE(toml) << wrong;
    EXPECT_EQ(toml.error().code, Errc::kInvalidOption);
    EXPECT_NE(toml.error().what.find("t:3: a table's name should follow"), std::string::npos)
        << toml.error().what;
  }
  for (const char* wrong : {"[",
                            "[[",
                            "[]",
                            "[[]]",
                            "[ [a]]",
                            "[a",
                            "[a]]",
                            "a = [",
                            "a = [1, }",
                            "a = [\n}\n",
                            "a = }"})
    EXPECT_FALSE(TomlReader::parse(wrong, "t")) << wrong;
}

TEST(TomlReader, ReadsArraysWhoseLinesBeginWithBrackets) {
  for (const char* good : {"a = [\n[+1],\n[-2], # [\n[\n]]\n[ b ]\nc = 1\n",
                           "[ 'a' ]\n[[\"b\"]]\n[-c]\n[_d]\n[3]\n"}) {
    const auto toml = TomlReader::parse(good, "t");
    EXPECT_TRUE(toml) << good << toml.error().what;
  }
}

TEST(TomlReader, NamesUnknownKeysWithLineAndNearestOne) {
  TomlReader toml =
      TomlReader::parse("frames = 1\n[light]\nilluminance = 3\n", "demo.toml").value();
  int frames = 0;
  double lux = 0;
  toml.read("frames", frames);
  TomlReader light = toml.table("light");
  light.read("illuminance_lux", lux);
  light.read("direction", lux);
  const Status status = toml.finish();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kInvalidOption);
  EXPECT_EQ(status.error().what,
            "demo.toml:3: light.illuminance: unknown key; did you mean \"illuminance_lux\"?");
}

TEST(TomlReader, CollectsEveryMistake) {
  TomlReader toml =
      TomlReader::parse("a = \"text\"\nb = [1, 2]\nc = -1\nd = inf\ne = 1.5\n", "t").value();
  double a = 7;
  Eigen::Vector3d b(1, 2, 3);
  std::uint64_t c = 9;
  double d = 8;
  int e = 3;
  double missing = 0;
  toml.read("a", a);
  toml.read("b", b);
  toml.read("c", c);
  toml.read("d", d);
  toml.read("e", e);
  toml.require("missing", missing);
  const std::string what = toml.finish().error().what;
  for (const char* part :
       {"t:1: a:", "t:2: b:", "t:3: c:", "t:4: d:", "t:5: e:", "missing: this key is missing"}) {
    EXPECT_NE(what.find(part), std::string::npos) << part << " in\n" << what;
  }
  EXPECT_EQ(a, 7) << "a wrong value must not get through";
  EXPECT_EQ(b, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(e, 3);
}

TEST(TomlReader, ReadsArraysOfTables) {
  TomlReader toml =
      TomlReader::parse("[[light]]\nlux = 1\n[[light]]\nlux = 2\nwrong = 1\n", "t").value();
  double sum = 0;
  for (TomlReader& light : toml.tables("light")) {
    double lux = 0;
    light.require("lux", lux);
    sum += lux;
  }
  EXPECT_EQ(sum, 3);
  EXPECT_NE(toml.finish().error().what.find("light[1].wrong"), std::string::npos);
  EXPECT_TRUE(toml.tables("nobody").empty());
}

TEST(TomlReader, LetsSettingsReplaceWhatTheFileSays) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.toml";
  ASSERT_TRUE(write_text(path, "frames = 1\n[render]\ndither = true\ncompensate = true\n"));
  TomlReader toml =
      TomlReader::open(path, {"render.dither = false", "frames=7", "new.x = 2.5"}).value();
  int frames = 0;
  bool dither = true;
  bool compensate = false;
  double x = 0;
  toml.read("frames", frames);
  TomlReader render = toml.table("render");
  render.read("dither", dither);
  render.read("compensate", compensate);
  toml.table("new").read("x", x);
  ASSERT_TRUE(toml.finish());
  EXPECT_EQ(frames, 7);
  EXPECT_FALSE(dither);
  EXPECT_TRUE(compensate);
  EXPECT_EQ(x, 2.5);
  TomlReader replaced = TomlReader::open(path, {"render = {dither = false}"}).value();
  EXPECT_FALSE(replaced.table("render").contains("compensate")) << "braces replace the whole table";
  const auto bad = TomlReader::open(path, {"render dither"});
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().what.find("render dither"), std::string::npos);
}

TEST(TomlReader, LeavesTheRestOfATableToOthersButNotThatOfTheTablesInIt) {
  TomlReader toml = TomlReader::parse("a = 1\n[mine]\nb = 2\nc = 3\n[other]\nd = 4\n", "t").value();
  int b = 0;
  toml.table("mine").read("b", b);
  toml.ignore_the_rest();
  const Status status = toml.finish();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().what.find("t:4: mine.c: unknown key"), 0U) << status.error().what;
  EXPECT_EQ(status.error().what.find('\n'), std::string::npos) << status.error().what;
}

TEST(TomlReader, NamesTheLineOfASyntaxError) {
  const auto toml = TomlReader::parse("a = 1\nb = \n", "t.toml");
  ASSERT_FALSE(toml);
  EXPECT_EQ(toml.error().code, Errc::kInvalidOption);
  EXPECT_NE(toml.error().what.find("t.toml:2"), std::string::npos) << toml.error().what;
}

TEST(TomlReader, TellsAMissingFileFromABadOne) {
  EXPECT_EQ(TomlReader::open("no-such.toml").error().code, Errc::kNotFound);
}

TEST(TomlReader, TakesAScalarWhereATableShouldBeAsAMistake) {
  TomlReader toml = TomlReader::parse("light = 3\n", "t").value();
  double lux = 0;
  toml.table("light").read("lux", lux);
  EXPECT_FALSE(toml.finish());
}

TEST(TomlReader, AgainForgetsWhatWasAskedAndWhatWasWrong) {
  TomlReader toml = TomlReader::parse("a = 1\nb = 2\n", "x.toml").value();
  int a = 0;
  toml.read("a", a);
  TomlReader again = toml.again();
  ASSERT_FALSE(toml.finish()) << "nobody asked for b";
  int b = 0;
  again.read("b", b);
  EXPECT_EQ(b, 2);
  const Status status = again.finish();
  ASSERT_FALSE(status) << "nobody asked it for a";
  EXPECT_NE(status.error().what.find("x.toml:1"), std::string::npos) << status.error().what;
}

TEST(TomlReader, TellsWhichKeysDiffer) {
  const std::string text =
      "a = 1\nb = \"x\"\nlist = [1, 2]\n[one]\nc = 2.5\nd = true\n[one.deep]\ne = 1\n[[path]]\n"
      "f = 1\n[[path]]\nf = 2\n";
  const auto differences = [&text](const std::string& other) {
    const TomlReader a = TomlReader::parse(text, "a").value();
    const TomlReader b = TomlReader::parse(other, "b").value();
    EXPECT_EQ(a.differences(b), b.differences(a)) << "whichever comes first";
    return a.differences(b);
  };
  const auto with = [&text](const std::string& from, const std::string& to) {
    std::string other = text;
    return other.replace(other.find(from), from.size(), to);
  };
  using Keys = std::vector<std::string>;
  EXPECT_EQ(differences(text), Keys());
  EXPECT_EQ(
      differences("# said otherwise\none = {d = true, deep = {e = 1}, c = 2.5}\nlist = [ 1,2 ]\n"
                  "b = \"x\"\na = 1\npath = [{f = 1}, {f = 2}]\n"),
      Keys());
  EXPECT_EQ(differences(with("a = 1", "a = 2")), Keys{"a"});
  EXPECT_EQ(differences(with("a = 1", "a = 1.0")), Keys{"a"});
  EXPECT_EQ(differences(with("a = 1\n", "")), Keys{"a"});
  EXPECT_EQ(differences(with("\"x\"", "\"y\"")), Keys{"b"});
  EXPECT_EQ(differences(with("[1, 2]", "[2, 1]")), Keys{"list"});
  EXPECT_EQ(differences(with("d = true", "d = false")), Keys{"one.d"});
  EXPECT_EQ(differences(with("e = 1", "e = 2\nnew = 0")), (Keys{"one.deep.e", "one.deep.new"}));
  EXPECT_EQ(differences(with("f = 2", "f = 3")), Keys{"path"});
  EXPECT_EQ(differences(with("[[path]]\nf = 2\n", "")), Keys{"path"});
  EXPECT_EQ(differences("a = {x = 1}\n"),
            (Keys{"a", "b", "list", "one.c", "one.d", "one.deep.e", "path"}));
}

}  // namespace
}  // namespace veneer
