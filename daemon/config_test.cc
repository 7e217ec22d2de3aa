// SPDX-License-Identifier: Apache-2.0
#include "daemon/config.h"

#include <gtest/gtest.h>

namespace veneer::daemon {
namespace {

constexpr const char* kLeast = "scene = \"s.toml\"\nmaterial = \"m\"\nprofile = \"p\"\n";

Status read(const std::string& more, Config* out = nullptr) {
  TomlReader toml = TomlReader::parse(std::string(kLeast) + more, "veneer.toml").value();
  Result<Config> config = Config::read(toml);
  if (config && out != nullptr) *out = *config;
  return toml.finish();
}

TEST(Config, HasDefaultsForAllButItsInputs) {
  Config config;
  const Status status = read("", &config);
  ASSERT_TRUE(status) << status.error().what;
  EXPECT_EQ(config.clock, ClockKind::kMonotonic);
  EXPECT_EQ(config.frames, 0U);
  EXPECT_TRUE(config.render.compensate);
}

TEST(Config, ReadsWhenThePoseIsLatched) {
  Config config;
  ASSERT_TRUE(read("", &config));
  EXPECT_EQ(config.latch, Latch::kLate);
  ASSERT_TRUE(read("[pacing]\nlatch = \"early\"\n", &config));
  EXPECT_EQ(config.latch, Latch::kEarly);
  const Status refused = read("[pacing]\nlatch = \"soon\"\n");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("\"late\" or \"early\""), std::string::npos);
}

TEST(Config, ReadsEveryKey) {
  Config config;
  ASSERT_TRUE(
      read("clock = \"virtual\"\nframes = 12\nframe_rate_hz = 50\ndisplay_latency_ms = 30\n"
           "summary = \"s.json\"\n[render]\ncompensate = false\ndither = false\n"
           "geometry_floor = 0.1\naverage_texels = true\nscale = 0.5\nevaluation = "
           "\"compute\"\ncache_spacing_px = 16\ncache_most_turn = "
           "0.2\n[prediction]\nhorizon_s = 0.1\n",
           &config));
  EXPECT_EQ(config.clock, ClockKind::kVirtual);
  EXPECT_EQ(config.frames, 12U);
  EXPECT_EQ(config.frame_rate_hz, 50);
  EXPECT_FALSE(config.render.compensate);
  EXPECT_EQ(config.render.geometry_floor, 0.1);
  EXPECT_TRUE(config.drawing.average_texels);
  EXPECT_EQ(config.drawing.scale, 0.5);
  EXPECT_EQ(config.drawing.evaluation, render::Evaluation::kCompute);
  EXPECT_EQ(config.drawing.cache.spacing, 16);
  EXPECT_EQ(config.drawing.cache.most_turn, 0.2);
  EXPECT_EQ(config.prediction.horizon_s, 0.1);
}

TEST(Config, ReadsWhatGivesWay) {
  Config config;
  ASSERT_TRUE(read("", &config));
  EXPECT_EQ(config.quality.mode, quality::GovernorMode::kBest) << "nothing, where nobody says so";
  ASSERT_TRUE(read("[quality]\nladder = \"l.toml\"\n", &config));
  EXPECT_EQ(config.quality.mode, quality::GovernorMode::kDeadline);
  EXPECT_EQ(config.quality.ladder.filename(), "l.toml");
  ASSERT_TRUE(read("[quality]\nmode = \"fixed\"\nrung = 3\ndeadline_ms = 12.5\n", &config));
  EXPECT_EQ(config.quality.mode, quality::GovernorMode::kFixed);
  EXPECT_EQ(config.quality.rung, 3);
  EXPECT_EQ(config.quality.deadline_ms, 12.5);
}

TEST(Config, ReadsWhoIsToSpeakWithIt) {
  Config config;
  ASSERT_TRUE(read("", &config));
  EXPECT_EQ(config.service.bus, "none") << "nobody, where nobody says so";
  EXPECT_EQ(config.service.metrics_port, 0);
  EXPECT_TRUE(config.service.metrics_file.empty());
  EXPECT_EQ(config.service.reload_requested, nullptr);
  ASSERT_TRUE(
      read("[service]\nbus = \"unix:path=/run/bus\"\nmetrics_port = 9709\nmetrics_file = "
           "\"/var/lib/a.prom\"\n",
           &config));
  EXPECT_EQ(config.service.bus, "unix:path=/run/bus");
  EXPECT_EQ(config.service.metrics_port, 9709);
  EXPECT_EQ(config.service.metrics_file, "/var/lib/a.prom");
  ASSERT_TRUE(read("[service]\nmetrics_port = 65535\nmetrics_file = \"sub/a.prom\"\n", &config));
  EXPECT_EQ(config.service.metrics_port, 65535);
  EXPECT_EQ(config.service.metrics_file, std::filesystem::absolute("sub/a.prom"))
      << "it refers to the folder of the file";
}

TEST(Config, RefusesWhatMakesNoSense) {
  for (const char* line : {"frame_rate_hz = 0",
                           "frame_rate_hz = -3",
                           "frames = -1",
                           "display_latency_ms = 1e9",
                           "clock = \"sundial\"",
                           "framerate = 60",
                           "[render]\ngeometry_floor = 0",
                           "[render]\ncache_spacing_px = 2",
                           "[render]\ncompensation = true",
                           "[quality]\nmode = \"fast\"",
                           "[quality]\nrung = 8",
                           "[quality]\nrung = -1",
                           "[quality]\ndeadline_ms = nan",
                           "[render]\nscale = 0.2",
                           "[render]\nscale = nan",
                           "[render]\nscale = 1.5",
                           "[render]\nevaluation = \"cpu\"",
                           "[service]\nbus = \"sytem\"",
                           "[service]\nbus = 1",
                           "[service]\nmetrics_port = -1",
                           "[service]\nmetrics_port = 65536",
                           "[service]\nmetrics_file = \"/a.txt\"",
                           "[service]\nmetrics = 1",
                           "[prediction]\nhorizon_s = -1"}) {
    const Status status = read(line);
    ASSERT_FALSE(status) << line;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption) << line;
  }
}

TEST(Config, NamesWhatIsMissing) {
  TomlReader toml = TomlReader::parse("scene = \"s\"\n", "veneer.toml").value();
  ASSERT_TRUE(Config::read(toml));
  const std::string what = toml.finish().error().what;
  EXPECT_NE(what.find("material"), std::string::npos);
  EXPECT_NE(what.find("profile"), std::string::npos);
}

}  // namespace
}  // namespace veneer::daemon
