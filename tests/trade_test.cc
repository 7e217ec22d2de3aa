// SPDX-License-Identifier: Apache-2.0
// `veneer trade` as a person runs it, and as a power cut ends it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <signal.h>

#include <array>
#include <chrono>
#include <map>
#include <set>
#include <sstream>
#include <thread>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "quality/candidate.h"
#include "quality/ladder.h"
#include "tests/facing_projector.h"
#include "tests/program.h"
#include "tests/program_child.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::chrono::milliseconds;

/// A sample of 3 x 3 texels, a small projector and a scene.
class TradeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    btf::SampleSetInfo info;
    info.width = info.height = 3;
    info.views = {btf::Direction::UnitZ()};
    for (int i = 0; i < 4; ++i) info.views.push_back(btf::direction_from_angles({0.9, 1.05 * i}));
    info.lights = info.views;
    auto writer = btf::SampleSetWriter::create(set_, info);
    ASSERT_TRUE(writer);
    Pcg32 random(5);
    for (int texel = 0; texel < info.texel_count(); ++texel)
      for (Eigen::half& value : writer->texel(texel))
        value = Eigen::half(static_cast<float>(0.1 + 0.5 * random.uniform()));
    ASSERT_TRUE(writer->finish());

    ASSERT_TRUE(facing_projector(64, 48).save(profile_));
    ASSERT_TRUE(write_text(scene_,
                           "mesh = \"plate\"\ntexture_repeats = [4, 4]\n"
                           "[observer.region]\nradius_m = [1, 1.2]\nazimuth_deg = [-20, 20]\n"
                           "elevation_deg = [0, 10]\n"
                           "[[light]]\ndirection = [0.3, 0.2, 1]\nilluminance_lux = 300\n"));
  }

  [[nodiscard]] std::string line(const fs::path& out, const std::string& more = "") const {
    return fmt::format(
        "veneer trade {} --scene {} --profile {} -o {} --models phong,lpca --views 1 --frames 3 "
        "--pixels 100 --iterations 2 --quiet {}",
        set_.string(),
        scene_.string(),
        profile_.string(),
        out.string(),
        more);
  }

  /// Runs it and kills it after a while. Returns whether it was still at work.
  [[nodiscard]] bool killed_after(milliseconds wait, const fs::path& out) const {
    const pid_t child = start(line(out));
    std::this_thread::sleep_for(wait);
    ::kill(child, SIGKILL);
    return wait_for(child) == 128 + SIGKILL;
  }

  TemporaryFolder folder_;
  fs::path set_ = folder_.path() / "tiny.btfset";
  fs::path profile_ = folder_.path() / "profile";
  fs::path scene_ = folder_.path() / "scene.toml";
};

/// What is the same each time.
json without_times(const fs::path& report) {
  json trade = json::parse(read_text(report / "trade.json").value());
  for (const char* key : {"date", "plain_ms"}) trade.erase(key);
  for (json& candidate : trade["candidates"])
    for (const char* key : {"ms_median", "ms_p95", "ratio", "fit_seconds", "pareto"})
      candidate.erase(key);
  return trade;
}

/// The journal's lines of one step: how often each key is there.
std::map<std::string, int> findings(const fs::path& report, const std::string& step) {
  std::map<std::string, int> counts;
  std::istringstream lines(read_text(report / "journal.jsonl").value_or(""));
  for (std::string text; std::getline(lines, text);) {
    const json found = json::parse(text, nullptr, false);
    if (found.is_object() && found.value("step", "") == step) ++counts[found["key"]];
  }
  return counts;
}

TEST_F(TradeTest, GoesOnWhereItWasKilledWithTheSameResult) {
  const fs::path whole = folder_.path() / "whole";
  const auto begin = std::chrono::steady_clock::now();
  const Outcome done = run(line(whole));
  const auto took =
      std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - begin);
  if (done.err.find("EGL") != std::string::npos && done.exit_code == 1)
    GTEST_SKIP() << "no GL here: " << done.err;
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const json expected = without_times(whole);
  ASSERT_GT(expected["candidates"].size(), 10U);

  const fs::path cut = folder_.path() / "cut";
  Pcg32 random(9);
  int kills = 0;
  for (int i = 0; i < 6; ++i)
    kills += killed_after(milliseconds(static_cast<int>(0.35 * random.uniform() *
                                                        static_cast<double>(took.count()))),
                          cut)
                 ? 1
                 : 0;
  EXPECT_GT(kills, 0);
  const Outcome finished = run(line(cut));
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_EQ(without_times(cut), expected);
  for (const char* step : {"fit", "screen", "timing"}) {
    const auto counts = findings(cut, step);
    EXPECT_EQ(counts.size(), findings(whole, step).size()) << step;
    for (const auto& [key, count] : counts) EXPECT_EQ(count, 1) << step << " " << key;
  }

  // Once it is complete nothing is measured again.
  const std::string journal = read_text(cut / "journal.jsonl").value();
  const json before = json::parse(read_text(cut / "trade.json").value());
  ASSERT_EQ(run(line(cut)).exit_code, 0);
  EXPECT_EQ(read_text(cut / "journal.jsonl").value(), journal);
  EXPECT_EQ(json::parse(read_text(cut / "trade.json").value()), before);

  // Budgets are asked of what was measured.
  const fs::path material = folder_.path() / "chosen.safetensors";
  const Outcome chosen =
      run(line(cut, fmt::format("--budget-ms 1e9 --material {} --json", material.string())));
  ASSERT_EQ(chosen.exit_code, 0) << chosen.err;
  EXPECT_TRUE(fs::exists(material));
  const json report = json::parse(chosen.out);
  double least = 1e9;
  for (const json& c : report["candidates"])
    least = std::min(least, c["received_de00_mean"].get<double>());
  int found = 0;
  for (const json& c : report["candidates"]) {
    if (c["key"] != report["chosen"]) continue;
    ++found;
    EXPECT_LE(c["received_de00_mean"], least + quality::kLeastGain);
  }
  EXPECT_EQ(found, 1);

  // What the daemon would step along is there, materials included.
  const auto ladder = quality::Ladder::load(cut / "ladder.toml");
  ASSERT_TRUE(ladder) << ladder.error().what;
  for (const quality::Rung& rung : ladder->rungs)
    EXPECT_TRUE(btf::load_material(rung.material)) << rung.name;
  fs::remove(material);
  std::string loud = line(cut, fmt::format("--budget-mb 0 --material {}", material.string()));
  loud.replace(loud.find("--quiet "), 8, "");
  EXPECT_TRUE(fails(run(loud), 3, "the least MB is"));
  // The nearest miss is said though all else is quiet.
  const Outcome quiet = run(line(cut, "--budget-mb 0"));
  EXPECT_TRUE(fails(quiet, 3, "the least MB is"));
  EXPECT_TRUE(fails(quiet, 3, " over"));
  EXPECT_FALSE(fs::exists(material));
  EXPECT_TRUE(fs::exists(cut / "index.html"));

  // Other models are another run, and so is another scene; the refusal names what differs.
  std::string fewer = line(cut);
  fewer.replace(fewer.find("phong,lpca"), 10, "phong");
  EXPECT_TRUE(fails(run(fewer), 2, "models: \"phong lpca\" then, \"phong\" now"));
  std::string text = read_text(scene_).value();
  ASSERT_TRUE(write_text(scene_, text + "[object]\nposition = [0, 0.01, 0]\n"));
  EXPECT_TRUE(fails(run(line(cut)), 2, "(scene: "));
}

TEST_F(TradeTest, RefusesWhatItCannotUse) {
  const fs::path out = folder_.path() / "report";
  std::string blind = line(out);
  blind.replace(blind.find("--views 1"), 9, "--views 0");
  EXPECT_TRUE(fails(run(blind), 2, "the number of views"));
  EXPECT_TRUE(fails(run(line(out, "--budget-ms=-1")), 2, "a budget of -1"));
  EXPECT_TRUE(fails(run(line(out, "--material m.safetensors")), 2, "--budget-ms"));
  EXPECT_EQ(run(line(out, "--grid medium")).exit_code, 2);
  std::string unknown = line(out);
  unknown.replace(unknown.find("phong,lpca"), 10, "fresnel");
  EXPECT_TRUE(fails(run(unknown), 2, "\"fresnel\""));
  ASSERT_TRUE(write_text(scene_,
                         "mesh = \"plate\"\n[[light]]\ndirection = [0, 0, 1]\n"
                         "illuminance_lux = 300\n"));
  EXPECT_TRUE(fails(run(line(out)), 2, "[observer.region]"));
  EXPECT_FALSE(fs::exists(out / "trade.json"));
}

}  // namespace
}  // namespace veneer
