// SPDX-License-Identifier: Apache-2.0
// veneer track as a person uses it. On real time, since it is about what comes now: limits are
// loose.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <csignal>
#include <thread>

#include "tests/program.h"
#include "tracking/drivers.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

class TrackTest : public testing::Test {
 protected:
  void SetUp() override {
    // Keys of other programs are none of its business, so one that nobody knows is there.
    ASSERT_TRUE(write_text(config_, R"(
scene = "scene.toml"
a_key_of_tomorrow = 1
[tracker]
driver = "simulated"
rate_hz = 100
latency_ms = 3
[[tracker.path]]
body = 4
kind = "fixed"
position = [1.0, 2.0, 3.0]
[[tracker.path]]
body = 9
kind = "orbit"
radius_m = 1
height_m = 0
from_deg = 0
rate_deg_s = 30
)"));
  }

  TemporaryFolder folder_;
  fs::path config_ = folder_.path() / "veneer.toml";
  fs::path file_ = folder_.path() / "poses.jsonl";
};

TEST_F(TrackTest, ListNamesEveryDriver) {
  const Outcome outcome = run("veneer track list");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Outcome as_json = run("veneer track list --json");
  const json parsed = json::parse(as_json.out);
  ASSERT_EQ(parsed.at("drivers").size(), tracking::drivers().size());
  for (const tracking::Driver& driver : tracking::drivers())
    EXPECT_THAT(outcome.out, HasSubstr(std::string(driver.name)));
  EXPECT_TRUE(parsed.at("plugged_in").is_array());
}

TEST_F(TrackTest, ListSaysHowTheConfiguredOneDoes) {
  const Outcome outcome = run("veneer track list " + config_.string() + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json parsed = json::parse(outcome.out);
  EXPECT_EQ(parsed.at("configured").at("state"), "tracking");
  EXPECT_EQ(parsed.at("configured").at("bodies").size(), 2U);
}

TEST_F(TrackTest, WatchMeasuresRateAndLatencyOfEveryBody) {
  const Outcome outcome = run("veneer track watch " + config_.string() + " --seconds 1 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json parsed = json::parse(outcome.out);  // and nothing else
  ASSERT_EQ(parsed.at("bodies").size(), 2U);
  const json& body = parsed.at("bodies").at(0);
  EXPECT_EQ(body.at("body"), 4);
  EXPECT_NEAR(body.at("rate_hz"), 100, 1e-3);  // by the times of measurement
  EXPECT_GE(body.at("latency_ms_mean"), 3);
  EXPECT_LT(body.at("latency_ms_mean"), 200) << "a busy machine may be late, but not so late";
  EXPECT_EQ(body.at("lost"), 0);
  EXPECT_EQ(body.at("position_m"), json({1.0, 2.0, 3.0}));
}

TEST_F(TrackTest, WatchWritesPlainLinesWhereThereIsNoTerminal) {
  const Outcome outcome = run("veneer track watch " + config_.string() + " --seconds 1.5");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out.find('\033'), std::string::npos);
  EXPECT_THAT(outcome.out, HasSubstr("tracking"));
  EXPECT_THAT(outcome.out, HasSubstr("+1.0000 +2.0000 +3.0000"));
  EXPECT_TRUE(outcome.err.empty()) << outcome.err;
}

TEST_F(TrackTest, SettingsReplaceWhatTheFileSays) {
  const Outcome outcome = run("veneer track watch " + config_.string() +
                              " --seconds 1 --json --set tracker.rate_hz=50");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NEAR(json::parse(outcome.out).at("bodies").at(0).at("rate_hz"), 50, 1e-3);
}

TEST_F(TrackTest, ARecordingSaysWhatWasWatched) {
  const Outcome recorded = run("veneer track record " + config_.string() + " -o " + file_.string() +
                               " --seconds 1 --json");
  ASSERT_EQ(recorded.exit_code, 0) << recorded.err;
  const Outcome replayed = run("veneer track replay " + file_.string() + " --json");
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  const json written = json::parse(recorded.out).at("bodies");
  const json read = json::parse(replayed.out).at("bodies");
  ASSERT_EQ(read.size(), 2U);
  for (const std::size_t i : {0U, 1U}) {
    for (const char* key : {"body", "samples", "lost", "rate_hz", "duration_s", "position_m"})
      EXPECT_EQ(read.at(i).at(key), written.at(i).at(key)) << key;
    EXPECT_NEAR(read.at(i).at("longest_gap_ms"), 10, 0.1);
    EXPECT_FALSE(read.at(i).contains("latency_ms_mean")) << "nobody knows it";
  }
  // The replay driver takes it.
  ASSERT_TRUE(write_text(folder_.path() / "replay.toml",
                         "[tracker]\ndriver = \"replay\"\nfile = \"poses.jsonl\"\n"));
  const Outcome watched =
      run("veneer track watch " + (folder_.path() / "replay.toml").string() + " --json");
  ASSERT_EQ(watched.exit_code, 0) << watched.err;  // ends by itself
  EXPECT_EQ(json::parse(watched.out).at("bodies").at(0).at("samples"), read.at(0).at("samples"));
}

TEST_F(TrackTest, GapsOfARecordingAreTold) {
  std::string text = "{\"format\":\"veneer-poses\",\"version\":1}\n";
  for (const int i : {0, 1, 2, 7, 8}) {
    text += fmt::format(
        "{{\"t_ns\":{},\"body\":0,\"seq\":{},\"p\":[0,0,0],\"q\":[1,0,0,0]}}\n", i * 10'000'000, i);
  }
  ASSERT_TRUE(write_text(file_, text + "{\"t_ns\":9"));
  const Outcome outcome = run("veneer track replay " + file_.string() + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json parsed = json::parse(outcome.out);
  EXPECT_EQ(parsed.at("truncated"), true);
  EXPECT_EQ(parsed.at("bodies").at(0).at("lost"), 4);
  EXPECT_NEAR(parsed.at("bodies").at(0).at("longest_gap_ms"), 50, 1e-6);
  EXPECT_THAT(outcome.err, HasSubstr("cut short"));
}

TEST_F(TrackTest, MistakesAreNamed) {
  EXPECT_TRUE(fails(run("veneer track"), 2, "subcommand"));
  EXPECT_TRUE(fails(run("veneer track watch"), 2, "config"));
  EXPECT_TRUE(fails(run("veneer track watch nothing.toml"), 1, "nothing.toml"));
  EXPECT_TRUE(fails(run("veneer track replay nothing.jsonl"), 1, "nothing.jsonl"));
  EXPECT_TRUE(fails(run("veneer track watch " + config_.string() + " --set tracker.rate_herz=1"),
                    2,
                    "did you mean \"rate_hz\"?"));
  EXPECT_TRUE(
      fails(run("veneer track watch " + config_.string() + " --set 'tracker.driver=\"magic\"'"),
            2,
            "simulated"));
  EXPECT_TRUE(
      fails(run("veneer track watch " + config_.string() + " --seconds -1"), 2, "--seconds"));
  EXPECT_FALSE(fs::exists(file_));
}

TEST_F(TrackTest, AStoppedRecordingIsWhole) {
  const std::string command = fmt::format("exec {}/veneer track record {} -o {} --quiet --json >{}",
                                          VENEER_PROGRAMS,
                                          config_.string(),
                                          file_.string(),
                                          (folder_.path() / "out").string());
  const pid_t pid = ::fork();
  ASSERT_GE(pid, 0);
  if (pid == 0) {
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  // Not before it runs: a minute is enough even under a sanitizer.
  for (int i = 0; i < 3000 && read_text(file_).value_or("").size() < 1000; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_EQ(::kill(pid, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(pid, &status, 0), pid);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  const json written = json::parse(read_text(folder_.path() / "out").value());
  const Outcome replayed = run("veneer track replay " + file_.string() + " --json");
  EXPECT_EQ(json::parse(replayed.out).at("truncated"), false);
  EXPECT_EQ(json::parse(replayed.out).at("bodies").at(0).at("samples"),
            written.at("bodies").at(0).at("samples"));
}

}  // namespace
}  // namespace veneer
