// SPDX-License-Identifier: Apache-2.0
#include "service/bus/command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <climits>
#include <limits>
#include <set>

#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using testing::ElementsAre;

std::string path_of_length(std::size_t length) { return "/" + std::string(length - 1, 'a'); }

TEST(Command, ReachesTheDaemonOnceWithAllThatItHolds) {
  FakeControl control;
  LightSetting light{{1, 2, 3}, 500, {0.5, 1, 0}};
  EXPECT_EQ(carry_out(LoadMaterial{"/m/a.safetensors"}, control).value(), "");
  EXPECT_EQ(carry_out(SetScene{"/s/b.toml"}, control).value(), "");
  EXPECT_EQ(carry_out(SetLight{2, light}, control).value(), "");
  EXPECT_EQ(carry_out(Blank{true}, control).value(), "");
  EXPECT_EQ(carry_out(Blank{false}, control).value(), "");
  EXPECT_EQ(carry_out(Reload{}, control).value(), "");
  EXPECT_EQ(carry_out(Snapshot{}, control).value(), "/var/lib/veneer/snapshot.png");
  EXPECT_THAT(control.told(),
              ElementsAre("material /m/a.safetensors",
                          "scene /s/b.toml",
                          "light 2 1 2 3 500 0.5 1 0",
                          "blank",
                          "unblank",
                          "reload",
                          "snapshot"));
}

TEST(Command, OfAPathThatIsNoneNeverReachesTheDaemon) {
  FakeControl control;
  for (const std::string& path : {std::string(),
                                  std::string("relative.safetensors"),
                                  std::string("~/a"),
                                  std::string("/a\nb"),
                                  std::string("/a\x7f"),
                                  std::string("/a\0b", 4),
                                  path_of_length(PATH_MAX)}) {
    for (const Command& command : {Command(LoadMaterial{path}), Command(SetScene{path})}) {
      const auto done = carry_out(command, control);
      ASSERT_FALSE(done) << path;
      EXPECT_EQ(done.error().code, Errc::kInvalidOption);
      EXPECT_LT(done.error().what.size(), 500U);
      EXPECT_EQ(done.error().what, readable(done.error().what));
    }
  }
  EXPECT_TRUE(control.told().empty());
  EXPECT_TRUE(carry_out(LoadMaterial{path_of_length(PATH_MAX - 1)}, control));
  EXPECT_TRUE(carry_out(LoadMaterial{"/"}, control));
}

TEST(Command, OfALightThatIsNoneNeverReachesTheDaemon) {
  FakeControl control;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const SetLight& command : {SetLight{-1, {}},
                                  SetLight{INT_MIN, {}},
                                  SetLight{0, {{0, 0, 0}, 1, {1, 1, 1}}},
                                  SetLight{0, {{0, 0, 1}, nan, {1, 1, 1}}},
                                  SetLight{0, {{0, 0, 1}, 1, {1, -1, 1}}}}) {
    const auto done = carry_out(command, control);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::kInvalidOption);
  }
  EXPECT_TRUE(control.told().empty());
  EXPECT_TRUE(carry_out(SetLight{INT_MAX, {}}, control)) << "how many there are, the daemon knows";
}

TEST(Command, RefusedByTheDaemonBringsItsText) {
  FakeControl control;
  control.refuse_with(Error{Errc::kNotFound, "no such file"});
  for (const Command& command :
       {Command(LoadMaterial{"/a"}), Command(Blank{}), Command(Reload{}), Command(Snapshot{})}) {
    const auto done = carry_out(command, control);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::kNotFound);
    EXPECT_EQ(done.error().what, "no such file");
  }
}

TEST(ErrorName, LeadsBackToItsCode) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(Errc::kCancelled); ++i) {
    const auto code = static_cast<Errc>(i);
    EXPECT_TRUE(names.insert(error_name_of(code)).second) << i;
    EXPECT_EQ(errc_of(error_name_of(code)), code);
  }
  EXPECT_EQ(error_name_of(Errc::kNotFound), "org.veneer.Veneer1.Error.NotFound");
  EXPECT_EQ(errc_of("org.freedesktop.DBus.Error.NoReply"), Errc::kUnavailable);
}

TEST(Readable, KeepsWellFormedTextAndIsThereAfterOnce) {
  const std::string good = "Ledersch\u00fcrze \u20ac \U0001F600\nnext \u07ff\u0800\ud7ff\uffff";
  EXPECT_EQ(readable(good), good);
  // Cut off, overlong, a surrogate, above U+10FFFF, a lone continuation, a control character.
  for (const char* bad : {"a\xc3",
                          "\xc0\xaf",
                          "\xe0\x80\x80",
                          "\xed\xa0\x80",
                          "\xf4\x90\x80\x80",
                          "\x80",
                          "\xff",
                          "\x1b[2J"}) {
    const std::string once = readable(bad);
    EXPECT_EQ(once.size(), std::string_view(bad).size()) << bad;
    EXPECT_NE(once.find('?'), std::string::npos) << bad;
    EXPECT_EQ(readable(once), once);
  }
}

}  // namespace
}  // namespace veneer::service
