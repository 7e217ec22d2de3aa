// SPDX-License-Identifier: Apache-2.0
// veneer track as a person uses it. On real time, since it is about what comes now: limits are
// loose.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <cmath>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/toml_reader.h"
#include "tests/program.h"
#include "tests/program_child.h"
#include "tracking/drivers.h"
#include "tracking/recording.h"

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

/// A body at 0.1 m from a point that it faces wherever it goes: that point, the eye of a head that
/// turns about it, stays at (0, 0, 0.1) in its frame.
std::string turning_head(double seconds) {
  std::string toml = R"(
[tracker]
driver = "simulated"
rate_hz = 240
noise_position_mm = 0.2
noise_rotation_deg = 0.02
[[tracker.path]]
body = 2
kind = "waypoints"
look_at = [0.5, 1.0, -2.0]
)";
  // So dense that the curve between them leaves the sphere by less than a micrometre.
  for (double t = 0; t < seconds; t += 0.05) {
    const double yaw = 0.5 * std::sin(2.9 * t);
    const double pitch = 0.3 * std::sin(4.3 * t + 1);
    toml += fmt::format("[[tracker.path.waypoint]]\ntime_s = {}\nposition = [{}, {}, {}]\n",
                        t,
                        0.5 + 0.1 * std::sin(yaw) * std::cos(pitch),
                        1.0 + 0.1 * std::sin(pitch),
                        -2.0 + 0.1 * std::cos(yaw) * std::cos(pitch));
  }
  return toml;
}

/// What the tracker of `toml` sends in so many seconds, its stamps late by `late_ms`.
void record(const std::string& toml, const fs::path& path, double seconds, double late_ms = 0) {
  VirtualClock clock(Time{std::chrono::seconds(50)});
  auto reader = TomlReader::parse(toml, "the tracker's table");
  ASSERT_TRUE(reader);
  TomlReader table = reader->table("tracker");
  auto tracker = tracking::open_tracker(table, clock);
  ASSERT_TRUE(tracker) << tracker.error().what;
  auto recorder = tracking::PoseRecorder::create(path);
  ASSERT_TRUE(recorder);
  while (clock.now() < Time{std::chrono::seconds(50)} + from_seconds(seconds)) {
    auto sample = (*tracker)->wait_pose(std::chrono::seconds(1));
    ASSERT_TRUE(sample);
    sample->time += from_seconds(1e-3 * late_ms);
    ASSERT_TRUE(recorder->write(*sample));
  }
}

TEST_F(TrackTest, TheEyeIsFoundInARecording) {
  ASSERT_NO_FATAL_FAILURE(record(turning_head(10), file_, 10));
  const std::string command = "veneer track eye --recording " + file_.string() + " --body 2";
  const Outcome outcome = run(command + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const json parsed = json::parse(outcome.out);
  EXPECT_EQ(parsed.at("good"), true);
  const auto eye = parsed.at("eye_in_sensor").get<std::vector<double>>();
  // 0.2 mm of noise over 2400 samples and some 0.2 rad of turning, ten times.
  EXPECT_NEAR(eye.at(0), 0, 3e-4);
  EXPECT_NEAR(eye.at(1), 0, 3e-4);
  EXPECT_NEAR(eye.at(2), 0.1, 3e-4);
  EXPECT_GT(parsed.at("span_deg").at(1), 20);
  EXPECT_THAT(run(command).out, HasSubstr("\neye_in_sensor = ["));
}

TEST_F(TrackTest, TheEyeIsFoundLive) {
  ASSERT_TRUE(write_text(config_, turning_head(60)));
  const Outcome outcome = run("veneer track eye " + config_.string() + " --body 2 --seconds 4");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("peephole"));
  EXPECT_THAT(outcome.err, HasSubstr("good enough"));  // how far it has come
  EXPECT_THAT(outcome.out, HasSubstr("eye_in_sensor = ["));
  EXPECT_TRUE(
      fails(run("veneer track eye " + config_.string() + " --body 3 --seconds 1"), 1, "of 2;"));
}

TEST_F(TrackTest, AnEyeThatIsNotKnownIsNotTold) {
  // Body 9 goes round a point, about one axis only.
  ASSERT_NO_FATAL_FAILURE(record(read_text(config_).value(), file_, 20));
  const std::string command = "veneer track eye --recording " + file_.string() + " --body 9";
  const Outcome outcome = run(command + " --json");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  const json parsed = json::parse(outcome.out);
  EXPECT_EQ(parsed.at("good"), false);
  EXPECT_FALSE(parsed.contains("eye_in_sensor"));
  EXPECT_THAT(parsed.at("why"), HasSubstr("at least 10"));
  const Outcome in_words = run(command);
  EXPECT_EQ(in_words.exit_code, 3);
  EXPECT_THAT(in_words.out, HasSubstr("about a second"));
  EXPECT_EQ(in_words.out.find("eye_in_sensor"), std::string::npos);
  EXPECT_TRUE(fails(run("veneer track eye --body 2"), 2, "--recording"));
  EXPECT_TRUE(
      fails(run("veneer track eye --recording " + file_.string() + " --body 5"), 1, "4, 9"));
}

TEST_F(TrackTest, TheLatencyIsThatOfTheTracker) {
  const fs::path reference = folder_.path() / "reference.jsonl";
  ASSERT_NO_FATAL_FAILURE(record(turning_head(10), file_, 10, 12.5));
  std::string other = turning_head(10);
  other.replace(other.find("body = 2"), 8, "body = 7");
  other.replace(other.find("rate_hz = 240"), 13, "rate_hz = 500\nseed = 5");
  ASSERT_NO_FATAL_FAILURE(record(other, reference, 10));
  const std::string command = fmt::format(
      "veneer track latency {} {} --body 2 --reference-body 7", file_.string(), reference.string());
  const Outcome outcome = run(command + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const json parsed = json::parse(outcome.out);
  EXPECT_EQ(parsed.at("good"), true);
  EXPECT_NEAR(parsed.at("latency_ms"), 12.5, 0.1);
  EXPECT_LT(parsed.at("deviation_ms"), 0.1);
  EXPECT_THAT(run(command).out, HasSubstr("\nlatency_ms = 12."));
  // It is farther off than is looked for, or of another body.
  EXPECT_EQ(run(command + " --max-ms 8").exit_code, 3);
  EXPECT_TRUE(fails(
      run(fmt::format("veneer track latency {} {} --body 2", file_.string(), reference.string())),
      1,
      "bodies in it are 7"));
}

TEST_F(TrackTest, ALatencyThatIsNotKnownIsNotTold) {
  ASSERT_NO_FATAL_FAILURE(record(read_text(config_).value(), file_, 10));
  // Body 4 is at rest, body 9 turns evenly.
  for (const int body : {4, 9}) {
    const Outcome outcome = run(fmt::format(
        "veneer track latency {} {} --body {} --json", file_.string(), file_.string(), body));
    EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
    const json parsed = json::parse(outcome.out);
    EXPECT_FALSE(parsed.contains("latency_ms"));
    EXPECT_FALSE(parsed.at("why").get<std::string>().empty());
  }
}

TEST_F(TrackTest, MistakesAreNamed) {
  EXPECT_TRUE(fails(run("veneer track"), 2, "say what to do: "));
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
  const pid_t pid = start(fmt::format("veneer track record {} -o {} --quiet --json >{}",
                                      config_.string(),
                                      file_.string(),
                                      (folder_.path() / "out").string()));
  // Not before it runs: a minute is enough even under a sanitizer.
  for (int i = 0; i < 3000 && read_text(file_).value_or("").size() < 1000; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_EQ(::kill(pid, SIGINT), 0);
  ASSERT_EQ(wait_for(pid), 0);
  const json written = json::parse(read_text(folder_.path() / "out").value());
  const Outcome replayed = run("veneer track replay " + file_.string() + " --json");
  EXPECT_EQ(json::parse(replayed.out).at("truncated"), false);
  EXPECT_EQ(json::parse(replayed.out).at("bodies").at(0).at("samples"),
            written.at("bodies").at(0).at("samples"));
}

}  // namespace
}  // namespace veneer
