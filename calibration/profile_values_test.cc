// SPDX-License-Identifier: Apache-2.0
// What a profile's values mean and which it may have; profile_test.cc is about its folder on disk.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "calibration/internal_profile_testing.h"
#include "calibration/profile.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

TEST(ProfileWhite, IsFullDriveOverBlack) {
  ProjectorProfile p = example_profile();
  const Eigen::Vector3d one = Eigen::Vector3d::Ones();
  EXPECT_TRUE(p.white().isApprox(p.primaries * one + p.black));
  const Eigen::Vector3d segment(0.2, 0.3, 0.25);
  p.residual = ColourResidual::sampled(
      2, [&](const Eigen::Vector3d& t) -> Eigen::Vector3d { return t.minCoeff() * segment; });
  EXPECT_TRUE(p.white().isApprox(p.primaries * (one + segment) + p.black));
  EXPECT_EQ(p.emitted(Eigen::Vector3d::Zero()), Xyz::Zero());
  EXPECT_EQ(p.linear_drive({0, 15, 0}), Eigen::Vector3d::UnitY());
}

struct Mistake {
  const char* reason;
  std::function<void(ProjectorProfile&)> make;
};

TEST(ProfileCheck, AcceptsTheExamples) {
  EXPECT_TRUE(example_profile().check());
  EXPECT_TRUE(example_with_map().check());
  EXPECT_TRUE(example_with_residual().check());
}

ColourResidual residual(const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& rho) {
  return ColourResidual::sampled(17, rho);
}

TEST(ProfileMaps, AreStretchedOverTheRasterBilinearly) {
  ProjectorProfile p = example_with_map();  // the raster is 64 x 48
  constexpr double kRounding = 1e-15;
  // Texel centres: the texels themselves; beyond the outermost ones nothing changes.
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 2; ++x)
      EXPECT_TRUE(p.reflectance_at({16 + 32 * x, 8 + 16 * y})
                      .isApprox(p.surface_map(x, y).cast<double>(), kRounding));
  EXPECT_EQ(p.reflectance_at({64, 48}), p.reflectance_at({48, 40}));
  EXPECT_EQ(p.vignetting_at({0, 0}), p.vignetting_at({64.0 / 6, 12}));
  // Between four: the weights of GL, here a quarter of the way right and three quarters down.
  const Eigen::Vector3d expected = (1 - 0.25 * 0.75) * p.surface_map(0, 1).cast<double>() +
                                   0.25 * 0.75 * p.surface_map(1, 2).cast<double>();
  EXPECT_TRUE(p.reflectance_at({24, 36}).isApprox(expected, kRounding));
  // A map's own size does not matter: one that is linear is looked up the same at any size.
  const auto ramp = [](int width, int height) {
    Image<float> map(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        map(x, y) = static_cast<float>(1 + (x + 0.5) / width + 2 * (y + 0.5) / height);
    return map;
  };
  for (const auto& [width, height] : {std::pair(4, 4), std::pair(64, 48), std::pair(7, 100)}) {
    p.vignetting = ramp(width, height);
    EXPECT_NEAR(p.vignetting_at({20, 30}), 1 + 20.0 / 64 + 2 * 30.0 / 48, 1e-6);
  }
  p.surface_map = {};
  EXPECT_EQ(p.reflectance_at({5, 6}), Eigen::Vector3d::Ones());
  p.vignetting = {};
  EXPECT_EQ(p.vignetting_at({5, 6}), 1.0);
}

TEST(ProfileCheck, RefusesEveryMistake) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::vector<Mistake> mistakes{
      {"raster", [](ProjectorProfile& p) { p.geometry.width = 0; }},
      {"focal", [](ProjectorProfile& p) { p.geometry.fx = 0; }},
      {"focal", [](ProjectorProfile& p) { p.geometry.fy = kInf; }},
      {"principal", [](ProjectorProfile& p) { p.geometry.cx = kNan; }},
      {"pose", [](ProjectorProfile& p) { p.geometry.world_from_projector.translation.x() = kNan; }},
      {"pose", [](ProjectorProfile& p) { p.geometry.world_from_projector.rotation.w() += 1; }},
      {"bits", [](ProjectorProfile& p) { p.bits = 0; }},
      {"bits", [](ProjectorProfile& p) { p.bits = 17; }},
      {"15 values", [](ProjectorProfile& p) { p.tone_curves[1].pop_back(); }},
      {"green is not finite", [](ProjectorProfile& p) { p.tone_curves[1][3] = kNan; }},
      {"green falls", [](ProjectorProfile& p) { p.tone_curves[1][3] = 0.9; }},
      {"blue runs", [](ProjectorProfile& p) { p.tone_curves[2][0] = -0.1; }},
      {"red runs", [](ProjectorProfile& p) { p.tone_curves[0][15] = 0.99; }},
      {"primaries", [](ProjectorProfile& p) { p.primaries.col(1) = 2 * p.primaries.col(0); }},
      {"primaries", [](ProjectorProfile& p) { p.primaries(1, 1) = kNan; }},
      {"primaries", [](ProjectorProfile& p) { p.primaries.col(2).setZero(); }},
      {"surface", [](ProjectorProfile& p) { p.surface.setZero(); }},
      {"surface", [](ProjectorProfile& p) { p.surface(2, 2) = kInf; }},
      {"black", [](ProjectorProfile& p) { p.black.y() = -1; }},
      {"ambient", [](ProjectorProfile& p) { p.ambient.z() = kNan; }},
      {"distance", [](ProjectorProfile& p) { p.reference_distance_m = 0; }},
      {"distance", [](ProjectorProfile& p) { p.reference_distance_m = kNan; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting = {}; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting(0, 0) = 0; }},
      {"vignetting", [](ProjectorProfile& p) { p.vignetting(2, 1) = std::nanf(""); }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 1).x() = 0; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(1, 2).y() = std::nanf(""); }},
      {"map", [](ProjectorProfile& p) { p.surface_map(1, 0).z() = HUGE_VALF; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).x() = -1; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).y() = 0.5F * kLeastReflectance; }},
      {"map", [](ProjectorProfile& p) { p.surface_map(0, 0).z() = 2.0F / kLeastReflectance; }},
      {"folds",
       [](ProjectorProfile& p) {  // no light at all
         p.residual = residual([](const Eigen::Vector3d& t) -> Eigen::Vector3d { return -t; });
       }},
      {"folds",
       [](ProjectorProfile& p) {  // red falls from 0.5 on
         p.residual = residual([](const Eigen::Vector3d& t) {
           return Eigen::Vector3d(-2.0 * std::max(t.x() - 0.5, 0.0), 0.0, 0.0);
         });
       }},
      {"folds",
       [](ProjectorProfile& p) {  // green and blue change places: a mirror
         p.residual = residual([](const Eigen::Vector3d& t) {
           return Eigen::Vector3d(0.0, t.z() - t.y(), t.y() - t.z());
         });
       }},
      {"residual is not finite, or above",
       [](ProjectorProfile& p) {
         p.residual = residual([](const Eigen::Vector3d& t) -> Eigen::Vector3d { return 11 * t; });
       }},
      {"UTF-8", [](ProjectorProfile& p) { p.colour_model = "\xff"; }},
      {"UTF-8", [](ProjectorProfile& p) { p.record["when"] = "\xc3"; }},
      {"UTF-8", [](ProjectorProfile& p) { p.record["\x80"] = "now"; }},
  };
  for (std::size_t i = 0; i < mistakes.size(); ++i) {
    ProjectorProfile profile = example_with_map();
    mistakes[i].make(profile);
    const Status status = profile.check();
    ASSERT_FALSE(status) << "mistake " << i << ": " << mistakes[i].reason;
    EXPECT_EQ(status.error().code, Errc::kBadFormat);
    EXPECT_THAT(status.error().what, HasSubstr(mistakes[i].reason)) << "mistake " << i;
  }
}

}  // namespace
}  // namespace veneer::calibration
