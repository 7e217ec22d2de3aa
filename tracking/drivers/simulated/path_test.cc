// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;

constexpr double kRoundingTolerance = 1e-12;  // a few ulp of metres through a rotation

Result<Path> path_of(const std::string& text) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  VENEER_ASSIGN(Path path, Path::read(toml));
  VENEER_TRY(toml.finish());
  return path;
}

const std::string kWalk = R"(
body = 3
kind = "walk"
centre = [0.1, 0.2, 0.3]
radius_m = 2
height_m = 0.5
from_deg = -30
to_deg = 60
period_s = 8
)";

/// Where the point that the observer faces lies in his own frame.
Vector3d in_view(const RigidTransform& world_from_observer, const Vector3d& point) {
  return world_from_observer.inverse() * point;
}

TEST(Path, WalkGoesThereAndBackBetweenItsEnds) {
  const auto path = path_of(kWalk);
  ASSERT_TRUE(path) << path.error().what;
  EXPECT_EQ(path->body(), 3);
  const Vector3d centre(0.1, 0.2, 0.3);
  // Angle 0 is along +z and grows towards +x.
  const auto on_arc = [&](double deg) {
    const double a = deg * std::numbers::pi / 180;
    return Vector3d(centre + Vector3d(2 * std::sin(a), 0.5, 2 * std::cos(a)));
  };
  for (const auto& [seconds, deg] :
       {std::pair{0.0, -30.0}, {2.0, 15.0}, {4.0, 60.0}, {6.0, 15.0}, {8.0, -30.0}}) {
    EXPECT_LT((path->at(seconds).translation - on_arc(deg)).norm(), kRoundingTolerance) << seconds;
  }
  // At rest at both ends.
  for (const double end : {0.0, 4.0}) {
    EXPECT_LT((path->at(end + 1e-4).translation - path->at(end).translation).norm(), 1e-7) << end;
  }
}

TEST(Path, ObserverFacesTheCentreWithALevelHead) {
  const auto path = path_of(kWalk);
  ASSERT_TRUE(path);
  for (double seconds = -1; seconds < 9; seconds += 0.37) {
    const RigidTransform pose = path->at(seconds);
    EXPECT_LT((in_view(pose, {0.1, 0.2, 0.3}) - Vector3d(0, 0, std::hypot(2, 0.5))).norm(),
              kRoundingTolerance);
    EXPECT_NEAR((pose.rotation * Vector3d::UnitX()).y(), 0, kRoundingTolerance);  // right is level
    EXPECT_LT((pose.rotation * Vector3d::UnitY()).y(), -0.9);                     // y is down
  }
}

TEST(Path, OrbitTurnsAtAConstantRate) {
  const auto path =
      path_of("kind = \"orbit\"\nradius_m = 1\nheight_m = 0.4\nfrom_deg = 10\nrate_deg_s = 45\n");
  ASSERT_TRUE(path) << path.error().what;
  const Eigen::Quaterniond step = path->at(0).rotation.conjugate() * path->at(0.5).rotation;
  for (double seconds = 0.5; seconds < 9; seconds += 0.5) {
    const Eigen::Quaterniond next =
        path->at(seconds).rotation.conjugate() * path->at(seconds + 0.5).rotation;
    EXPECT_LT(step.angularDistance(next), 1e-7) << seconds;  // acos near 1 halves the digits
  }
  EXPECT_NEAR(step.angularDistance(Eigen::Quaterniond::Identity()), std::numbers::pi / 8, 1e-9);
  EXPECT_LT((path->at(8).translation - path->at(0).translation).norm(), kRoundingTolerance);
}

TEST(Path, FixedStaysWhereItWasPut) {
  const auto path = path_of("kind = \"fixed\"\nposition = [1, 2, 3]\nrotation_deg = [0, 90, 0]\n");
  ASSERT_TRUE(path);
  for (const double seconds : {-5.0, 0.0, 100.0}) {
    EXPECT_EQ(path->at(seconds).translation, Vector3d(1, 2, 3));
    EXPECT_LT((path->at(seconds).rotation * Vector3d::UnitZ() - Vector3d::UnitX()).norm(),
              kRoundingTolerance);
  }
}

TEST(Path, TurnKeepsItsPlaceAndItsAxis) {
  const auto path = path_of(
      "kind = \"turn\"\nposition = [1, 2, 3]\naxis = [0, 2, 0]\nfrom_deg = -60\nto_deg = 60\n"
      "period_s = 4\n");
  ASSERT_TRUE(path) << path.error().what;
  for (double seconds = -3; seconds < 9; seconds += 0.37) {
    EXPECT_EQ(path->at(seconds).translation, Vector3d(1, 2, 3));
    EXPECT_LT((path->at(seconds).rotation * Vector3d::UnitY() - Vector3d::UnitY()).norm(),
              kRoundingTolerance);
  }
  // A positive angle turns +z towards +x.
  EXPECT_NEAR((path->at(0).rotation * Vector3d::UnitZ()).x(), -std::sqrt(0.75), kRoundingTolerance);
  EXPECT_NEAR((path->at(2).rotation * Vector3d::UnitZ()).x(), std::sqrt(0.75), kRoundingTolerance);
  EXPECT_FALSE(
      path_of("kind = \"turn\"\naxis = [0, 0, 0]\nfrom_deg = 0\nto_deg = 1\nperiod_s = 1\n"));
}

TEST(Path, WaypointsAreMetInTimeOnACurveWithoutKinks) {
  const auto path = path_of(R"(
kind = "waypoints"
look_at = [0, 0, 0]
waypoint = [ { time_s = 1, position = [0, 1, 2] }, { time_s = 2, position = [1, 1, 1] },
             { time_s = 5, position = [2, 1, 0] }, { time_s = 6, position = [2, 0.5, -1] } ]
)");
  ASSERT_TRUE(path) << path.error().what;
  EXPECT_LT((path->at(0).translation - Vector3d(0, 1, 2)).norm(), kRoundingTolerance);
  EXPECT_LT((path->at(1).translation - Vector3d(0, 1, 2)).norm(), kRoundingTolerance);
  EXPECT_LT((path->at(2).translation - Vector3d(1, 1, 1)).norm(), kRoundingTolerance);
  EXPECT_LT((path->at(5).translation - Vector3d(2, 1, 0)).norm(), kRoundingTolerance);
  EXPECT_LT((path->at(9).translation - Vector3d(2, 0.5, -1)).norm(), kRoundingTolerance);
  constexpr double kStep_s = 1e-6;
  for (const double corner : {1.0, 2.0, 5.0, 6.0}) {
    const Vector3d before = path->at(corner).translation - path->at(corner - kStep_s).translation;
    const Vector3d after = path->at(corner + kStep_s).translation - path->at(corner).translation;
    // Accelerations are some 10 m/s^2 at most.
    EXPECT_LT((after - before).norm() / kStep_s, 1e-4) << corner;
  }
  for (double seconds = 0; seconds < 7; seconds += 0.1) {
    const Vector3d target = in_view(path->at(seconds), Vector3d::Zero());
    EXPECT_LT(target.head<2>().norm(), kRoundingTolerance) << seconds;
    EXPECT_GT(target.z(), 0);
  }
}

TEST(Path, PassesThroughTheTargetWithoutNan) {
  const auto path = path_of(R"(
kind = "waypoints"
look_at = [0, 0, 0]
waypoint = [ { time_s = 0, position = [0, 0, 0] }, { time_s = 1, position = [0, 1, 0] } ]
)");
  ASSERT_TRUE(path);
  for (const double seconds : {0.0, 0.5, 1.0}) {  // in it, and straight above it
    EXPECT_NEAR(path->at(seconds).rotation.norm(), 1, kRoundingTolerance) << seconds;
  }
}

TEST(Path, RefusesWhatItCannotWalk) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = kWalk;
    text.replace(text.find(from), from.size(), to);
    return path_of(text);
  };
  const std::string points = "kind = \"waypoints\"\nlook_at = [0, 0, 0]\n";
  for (const Result<Path>& path :
       {with("\"walk\"", "\"run\""),
        with("kind = \"walk\"", ""),
        with("radius_m = 2", ""),
        with("radius_m = 2", "radius_m = 0"),
        with("period_s = 8", "period_s = 0"),
        with("height_m = 0.5", "height_m = \"tall\""),
        with("to_deg = 60", "to_deg = 1e300"),
        with("to_deg = 60", "to_deg = 60\nspeed = 1"),
        path_of(points),
        path_of(points + "waypoint = [ { time_s = 0, position = [0, 0, 1] } ]"),
        path_of(points + "waypoint = [ { time_s = 1, position = [0, 0, 1] }, { time_s = 1, "
                         "position = [0, 1, 1] } ]"),
        path_of("kind = \"fixed\"\nrotation_deg = [0, 1e300, 0]")}) {
    ASSERT_FALSE(path);
    EXPECT_EQ(path.error().code, Errc::kInvalidOption);
  }
  EXPECT_NE(with("radius_m = 2", "radius_m = -1").error().what.find("radius_m"), std::string::npos);
}

}  // namespace
}  // namespace veneer::tracking
