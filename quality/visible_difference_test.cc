// SPDX-License-Identifier: Apache-2.0
#include "quality/visible_difference.h"

#include <gtest/gtest.h>

#include "quality/internal_test_scenes.h"

namespace veneer::quality {
namespace {

using testing::front_projector;

btf::SampleSetInfo one_texel() {
  btf::SampleSetInfo info;
  info.width = info.height = 1;
  info.views = info.lights = btf::bonn_directions();
  return info;
}

Reflecting grey(double value) {
  return [value](int, const btf::Direction&, const btf::Direction&) -> Eigen::Vector3d {
    return Eigen::Vector3d::Constant(value);
  };
}

class OnAPlate : public ::testing::Test {
 protected:
  void SetUp() override {
    SilentProgress silent;
    auto reach = find_reach(testing::plate(-30, 30, 1),
                            front_projector(),
                            one_texel(),
                            silent,
                            {.samples = 4096, .kept = 256});
    ASSERT_TRUE(reach) << reach.error().what;
    reach_ = *reach;
  }
  VisibleDifferences differences(const calibration::ProjectorProfile& profile) {
    auto made = VisibleDifferences::make(profile, reach_.asked, one_texel());
    if (!made) throw std::runtime_error(made.error().what);
    return std::move(*made);
  }
  Reach reach_;
};

TEST_F(OnAPlate, EqualMaterialsDifferByNothing) {
  auto d = differences(front_projector());
  d.set_reference(grey(0.4));
  const VisibleDifference none = d.of(grey(0.4));
  EXPECT_EQ(none.de00_max, 0);
  EXPECT_EQ(none.codes_max, 0);
  EXPECT_EQ(none.rmse, 0);
  EXPECT_TRUE(none.is_never_seen());
}

// One plain colour in the middle of the gamut: what is sent is what was asked for.
TEST_F(OnAPlate, DifferencesAreThoseOfTheTargets) {
  const auto profile = front_projector();
  auto d = differences(profile);
  d.set_reference(grey(0.4));
  const VisibleDifference seen = d.of(grey(0.5));
  const auto lab = [&](double value) {
    return lab_from_xyz(xyz_from_srgb() * Eigen::Vector3d::Constant(value * 300 / std::numbers::pi),
                        profile.white());
  };
  const double exact = delta_e_2000(lab(0.4), lab(0.5));
  constexpr double kDrive = 1e-6;  // levels are kept in single precision
  EXPECT_NEAR(seen.de00_mean, exact, kDrive);
  EXPECT_NEAR(seen.de00_p95, exact, kDrive);
  EXPECT_NEAR(seen.de00_max, exact, kDrive);
  EXPECT_NEAR(seen.rmse, 0.1, 1e-12);
  EXPECT_GE(seen.codes_max, seen.codes_p95);
  EXPECT_GE(seen.codes_p95, 5.0);
  EXPECT_FALSE(seen.is_never_seen());
}

TEST_F(OnAPlate, WhatTheProjectorCannotShowIsNotSeen) {
  auto d = differences(front_projector());
  // Far over full white, and one and a half times that: both are white.
  d.set_reference(grey(400));
  EXPECT_TRUE(d.of(grey(600)).is_never_seen());
  // Under its black.
  d.set_reference(grey(0));
  EXPECT_TRUE(d.of(grey(1e-6)).is_never_seen());
}

// The fewer bits, the more is lost between two codes; what is sent on average stays.
TEST_F(OnAPlate, CodesCountTheStepsOfTheProjector) {
  auto coarse = front_projector();
  coarse.bits = 4;
  for (auto& curve : coarse.tone_curves) {
    curve.clear();
    for (int code = 0; code < 16; ++code) curve.push_back(std::pow(code / 15.0, 2.2));
  }
  auto fine = differences(front_projector());
  auto few = differences(coarse);
  fine.set_reference(grey(0.5));
  few.set_reference(grey(0.5));
  const VisibleDifference a = fine.of(grey(0.52));
  const VisibleDifference b = few.of(grey(0.52));
  EXPECT_NEAR(a.de00_mean, b.de00_mean, 1e-5);
  EXPECT_NEAR(a.codes_mean, 17 * b.codes_mean, 0.15 * a.codes_mean);
  EXPECT_LT(b.codes_max, 1.0);
  EXPECT_TRUE(b.is_never_seen());
}

TEST_F(OnAPlate, RefusesADamagedProfile) {
  auto broken = front_projector();
  broken.primaries.setZero();
  EXPECT_FALSE(VisibleDifferences::make(broken, reach_.asked, one_texel()));
}

}  // namespace
}  // namespace veneer::quality
