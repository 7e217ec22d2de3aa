// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/tracked_probes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "base/toml_reader.h"
#include "tracking/drivers.h"

namespace veneer::calibration {
namespace {

using testing::HasSubstr;

/// A simulated tracker of one body on time of its own.
struct Tracked {
  VirtualClock clock;
  std::unique_ptr<tracking::Tracker> tracker;

  explicit Tracked(const std::string& path, const std::string& noise = "") {
    auto toml = TomlReader::parse(
        "driver = \"simulated\"\nrate_hz = 120\n" + noise + "\n[[path]]\nbody = 4\n" + path,
        "test");
    VENEER_CHECK(toml.has_value());
    auto opened = tracking::open_tracker(*toml, clock);
    if (!opened) ADD_FAILURE() << opened.error().what;
    VENEER_CHECK(opened.has_value());
    tracker = std::move(*opened);
  }
};

constexpr const char* kFixed =
    "kind = \"fixed\"\nposition = [0.1, 0.2, 0.3]\nrotation_deg = [90, 0, 0]\n";

TEST(TrackedPoseProbe, MeasuresABodyThatStandsStill) {
  Tracked tracked(kFixed);
  TrackedPoseProbe probe(*tracked.tracker, 4, {});
  const auto pose = probe.measure();
  ASSERT_TRUE(pose) << pose.error().what;
  constexpr double kRounding = 1e-12;
  EXPECT_LT((pose->world_from_body.translation - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), kRounding);
  EXPECT_GT(pose->samples, 100);
}

TEST(TrackedPointProbe, AddsTheTipInTheSensorsFrame) {
  Tracked tracked(kFixed);
  const Eigen::Vector3d tip(0.01, 0.02, 0.15);
  TrackedPointProbe probe(*tracked.tracker, 4, tip, {});
  const auto point = probe.measure();
  ASSERT_TRUE(point) << point.error().what;
  TrackedPoseProbe sensor(*tracked.tracker, 4, {});
  const auto pose = sensor.measure();
  ASSERT_TRUE(pose) << pose.error().what;
  EXPECT_LT((point->x_in_world - pose->world_from_body * tip).norm(), 1e-9);
  EXPECT_NEAR((point->x_in_world - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), tip.norm(), 1e-9);
  EXPECT_GT(point->deviation_m, 0);  // of no use as a weight otherwise
}

TEST(TrackedPoseProbe, ABodyThatMovesIsWaitedForAndThenRefused) {
  Tracked tracked(
      "kind = \"orbit\"\ncentre = [0, 0, 0]\nradius_m = 0.5\nheight_m = 0\nfrom_deg = 0\n"
      "rate_deg_s = 40\nlook_at = [0, 0, 0]\n");
  StillOptions options;
  options.patience_s = 5;
  TrackedPoseProbe probe(*tracked.tracker, 4, options);
  const auto pose = probe.measure();
  ASSERT_FALSE(pose);
  EXPECT_EQ(pose.error().code, Errc::kTimeout);
  EXPECT_THAT(pose.error().what, HasSubstr("still"));
}

TEST(TrackedPoseProbe, SaysThatABodyIsNotSeen) {
  Tracked tracked(kFixed);
  StillOptions options;
  options.patience_s = 1;
  TrackedPoseProbe probe(*tracked.tracker, 9, options);
  const auto pose = probe.measure();
  ASSERT_FALSE(pose);
  EXPECT_EQ(pose.error().code, Errc::kTimeout);
  EXPECT_THAT(pose.error().what, HasSubstr("not seen"));
}

}  // namespace
}  // namespace veneer::calibration
