// SPDX-License-Identifier: Apache-2.0
// veneerd as a person uses it: what it refuses, what it leaves, and what it does while it runs.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "base/files.h"
#include "tests/daemon_child.h"
#include "tests/programs_fixture.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

TEST_F(ProgramsTest, AMeshWithoutTextureCoordinatesIsRefused) {
  ASSERT_TRUE(write_text(at("bare.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  std::string scene = read_text(at("scene.toml")).value();
  scene.replace(scene.find("\"sphere\""), 8, "\"bare.obj\"");
  ASSERT_TRUE(write_text(at("bare.toml"), scene));
  EXPECT_TRUE(fails(run("veneerd --config " + text("veneer.toml") +
                        " --set 'scene=\"bare.toml\"' --set frames=1"),
                    1,
                    "texture coordinates"));
}

TEST_F(ProgramsTest, UnknownKeysAreNamedWithTheirLine) {
  std::string config = read_text(at("veneer.toml")).value();
  ASSERT_TRUE(write_text(at("wrong.toml"), "framerate_hz = 60\n" + config));
  EXPECT_TRUE(fails(
      run("veneerd --config " + text("wrong.toml")), 2, "wrong.toml:1: framerate_hz: unknown key"));
  EXPECT_TRUE(
      fails(run("veneerd --config " + text("veneer.toml") + " --set tracker.rate=1"), 2, "rate"));
  const std::string scene = read_text(at("scene.toml")).value();
  ASSERT_TRUE(write_text(at("odd.toml"), scene + "\ncolor = 3\n"));
  EXPECT_TRUE(fails(
      run("veneerd --config " + text("veneer.toml") + " --set 'scene=\"odd.toml\"'"), 2, "color"));
}

TEST_F(ProgramsTest, ADamagedProfileIsRefused) {
  fs::remove_all(at("bad-profile"));
  fs::copy(at("profile"), at("bad-profile"), fs::copy_options::recursive);
  cut_in_half(at("bad-profile") / "profile.json");
  EXPECT_TRUE(
      fails(run("veneerd --config " + text("veneer.toml") + " --set 'profile=\"bad-profile\"'"),
            1,
            "profile.json"));
}

TEST_F(ProgramsTest, TheDaemonMakesTheSameFramesTwice) {
  for (const char* name : {"first", "second"}) {
    const Outcome outcome =
        run(fmt::format("veneerd --config {} --set frames=3 --set 'output.folder=\"{}\"' --set "
                        "'summary=\"{}.json\"'",
                        text("veneer.toml"),
                        name,
                        name));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  const auto summary = nlohmann::json::parse(read_text(at("first.json")).value());
  EXPECT_EQ(summary.at("frames"), 3);
  EXPECT_GT(summary.at("frame_ms_p50"), 0);
  for (int frame = 0; frame < 3; ++frame) {
    const std::string name = fmt::format("frame-{:06}.png", frame);
    EXPECT_EQ(read_text(at("first") / name).value(), read_text(at("second") / name).value())
        << name;
  }
}

TEST_F(ProgramsTest, AReplayedRecordingGivesTheSameFrames) {
  const std::string run_it =
      "veneerd --config " + text("veneer.toml") + " --set frames=3 --set 'output.folder=\"";
  const Outcome live =
      run(run_it + "live\"' --set tracker.latency_ms=0 --set 'record=\"poses.jsonl\"'");
  ASSERT_EQ(live.exit_code, 0) << live.err;
  const Outcome replayed =
      run(run_it + "replayed\"' --set 'tracker={driver=\"replay\", file=\"poses.jsonl\"}'");
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  for (int frame = 0; frame < 3; ++frame) {
    const std::string name = fmt::format("frame-{:06}.png", frame);
    EXPECT_EQ(read_text(at("live") / name).value(), read_text(at("replayed") / name).value())
        << name;
  }
}

TEST_F(ProgramsTest, TheDaemonStopsCleanlyOnSigterm) {
  Daemon daemon({"--quiet",
                 "--config",
                 text("veneer.toml"),
                 "--set",
                 "clock=\"monotonic\"",
                 "--set",
                 "frames=0",
                 "--set",
                 "output={driver=\"file\", folder=\"stopped\"}",
                 "--set",
                 "summary=\"stopped.json\""},
                at("stopped.log"));
  // Not before it runs.
  ASSERT_TRUE(wait_until([] { return fs::exists(at("stopped") / "frame-000001.png"); }, kPatience))
      << daemon.log();
  EXPECT_EQ(daemon.stop(), 0) << daemon.log();
  const auto json = nlohmann::json::parse(read_text(at("stopped.json")).value_or("{}"));
  EXPECT_GE(json.value("frames", 0), 2);
}

/// Of a daemon that runs in real time without an output until it is stopped, with the profile live.
std::vector<std::string> live_arguments(const std::string& config,
                                        const std::string& profile,
                                        double frame_rate_hz) {
  return {"--config",
          config,
          "--set",
          "clock=\"monotonic\"",
          "--set",
          "frames=0",
          "--set",
          fmt::format("frame_rate_hz={}", frame_rate_hz),
          "--set",
          "output={driver=\"null\"}",
          "--set",
          fmt::format("profile=\"{}\"", profile),
          "--set",
          fmt::format("summary=\"{}.json\"", profile)};
}

TEST_F(ProgramsTest, TheDaemonTakesNewProfilesAndRefusesADamagedOne) {
  publish_profile("live");
  Daemon daemon(live_arguments(text("veneer.toml"), text("live"), 10), at("live.log"));
  ASSERT_TRUE(daemon.says("output:")) << daemon.log();
  const std::string exchanged = "profile was exchanged";
  for (int times = 1; times <= 3; ++times) {
    publish_profile("live");
    ASSERT_TRUE(daemon.says(exchanged, times)) << daemon.log();
  }
  daemon.hang_up();
  ASSERT_TRUE(daemon.says(exchanged, 4)) << "what did not change is read again: " << daemon.log();
  cut_in_half(at("live") / "vignetting.exr");
  daemon.hang_up();
  ASSERT_TRUE(daemon.says("vignetting.exr was changed or damaged")) << daemon.log();
  publish_profile("live");
  ASSERT_TRUE(daemon.says(exchanged, 5)) << daemon.log();
  ASSERT_EQ(daemon.stop(), 0) << daemon.log();

  const auto summary = nlohmann::json::parse(read_text(at("live.json")).value());
  EXPECT_EQ(summary.at("profile_reloads"), 5);
  EXPECT_EQ(summary.at("profile_refusals"), 1);
  EXPECT_GT(summary.at("profile_swap_ms_max"), 0);
}

TEST_F(ProgramsTest, ExchangingProfilesDropsNoFrame) {
  // Another program may take the machine for a moment in either run; a daemon that drops a frame
  // for every profile does so each time.
  constexpr int kTries = 4;
  constexpr int kExchanges = 3;
  bool as_few = false;
  for (int i = 0; i < kTries && !as_few; ++i) {
    std::array<std::uint64_t, 2> dropped{};
    for (const bool exchange : {false, true}) {
      publish_profile("live");
      Daemon daemon(live_arguments(text("veneer.toml"), text("live"), 5), at("live.log"));
      ASSERT_TRUE(daemon.says("output:")) << daemon.log();
      const auto begin = std::chrono::steady_clock::now();
      for (int times = 1; exchange && times <= kExchanges; ++times) {
        publish_profile("live");
        ASSERT_TRUE(daemon.says("profile was exchanged", times)) << daemon.log();
      }
      // Either run takes as long, so that it has as much opportunity.
      std::this_thread::sleep_until(begin + std::chrono::seconds(2 * kExchanges));
      ASSERT_EQ(daemon.stop(), 0) << daemon.log();
      const auto summary = nlohmann::json::parse(read_text(at("live.json")).value());
      EXPECT_EQ(summary.at("profile_reloads"), exchange ? kExchanges : 0);
      dropped[exchange ? 1 : 0] = summary.at("dropped_frames").get<std::uint64_t>();
    }
    as_few = dropped[1] <= dropped[0];
  }
  EXPECT_TRUE(as_few) << "exchanging profiles dropped frames in all of " << kTries << " tries";
}

TEST_F(ProgramsTest, TheDaemonStartsWithAnOlderProfileWhereTheNewestIsDamaged) {
  for (const char* name : {"aged", "aged.history/2026-01-02T03-04-05.678Z"}) {
    fs::create_directories(at(name).parent_path());
    fs::copy(at("profile"), at(name), fs::copy_options::recursive);
  }
  cut_in_half(at("aged") / "profile.json");
  const Outcome outcome =
      run("veneerd --config " + text("veneer.toml") + " --set frames=1 --set 'profile=\"aged\"'");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("2026-01-02T03-04-05.678Z"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace veneer
