// SPDX-License-Identifier: Apache-2.0
// Compensation with a colour residual: compensation.h, calibration/drive_correction.h.
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/ipt.h"
#include "base/random.h"
#include "render/compensation.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr int kBits = 8;
const Vector3d kEven = Vector3d::Ones();  // a surface without a map

const calibration::ProjectorProfile& profile() {
  static const auto kProfile = [] {
    auto made = example_profile(64, 48, kBits);
    made.residual = example_residual();
    return made;
  }();
  return kProfile;
}

// The image formation as ProjectorProfile states it, written down again.
Xyz shown(const Vector3d& t, double g, const Vector3d& reflectance = kEven) {
  const auto& p = profile();
  const Eigen::Matrix3d surface =
      p.surface * p.primaries * reflectance.asDiagonal() * p.primaries.inverse();
  return surface * (g * (p.primaries * (t + p.residual(t)) + p.black) + p.ambient);
}
Vector3d random_drive(Pcg32& random) {
  const double r = random.uniform();
  const double g = random.uniform();
  return {r, g, random.uniform()};
}
Ipt ipt_of(const Xyz& xyz) {
  return ipt_from_cones(
      (cones_from_xyz() * xyz).cwiseQuotient(cones_from_xyz() * profile().white()));
}
CompensatedPixel compensate(const Compensation& compensation, const Xyz& target, double g) {
  return compensation.pixel(target, g, 1.0, kEven, 3, 5, 7);
}

TEST(ResidualCompensation, IsMadeForTheProfile) {
  EXPECT_TRUE(profile().check());
  EXPECT_FALSE(Compensation(profile(), {}).correction().empty());
  EXPECT_TRUE(Compensation(profile(), {.compensate = false}).correction().empty());
  EXPECT_TRUE(Compensation(example_profile(64, 48, kBits), {}).correction().empty());
}

// What DriveCorrection promises: within what nobody sees.
constexpr double kMeanDifference = 0.05;
constexpr double kMostDifference = 0.3;

TEST(ResidualCompensation, SendsReachableTargets) {
  const Compensation compensation(profile(), {});
  Pcg32 random(1);
  double sum = 0;
  double sum_without = 0;
  auto ignorant = profile();
  ignorant.residual = {};
  const Compensation without(ignorant, {});
  constexpr int kTargets = 5000;
  for (int i = 0; i < kTargets; ++i) {
    const double g = 0.3 + random.uniform();
    Vector3d t = random_drive(random);
    if (i % 2 == 0) t = t.array().pow(2.4).matrix();
    const Xyz target = shown(t, g);
    const Xyz white = shown(Vector3d::Ones(), g);
    const auto difference = [&](const CompensatedPixel& pixel) {
      return delta_e_2000(lab_from_xyz(target, white), lab_from_xyz(shown(pixel.drive, g), white));
    };
    const CompensatedPixel pixel = compensate(compensation, target, g);
    ASSERT_LT(difference(pixel), kMostDifference) << t.transpose() << ", G " << g;
    ASSERT_TRUE(pixel.state == PixelState::kInGamut ||
                std::min(t.minCoeff(), 1.0 - t.maxCoeff()) < 1e-3)
        << t.transpose();
    sum += difference(pixel);
    sum_without += difference(compensate(without, target, g));
  }
  EXPECT_LT(sum / kTargets, kMeanDifference);
  EXPECT_GT(sum_without / kTargets, 2.0) << "the residual is too small to test with";
}

TEST(ResidualCompensation, SendsBlackAndFullDriveExactly) {
  const Compensation compensation(profile(), {});
  constexpr double kRounding = 1e-9;
  for (const double g : {0.05, 1.0, 2.0}) {
    for (const Vector3d& t : {Vector3d(0, 0, 0), Vector3d(1, 1, 1)}) {
      const CompensatedPixel pixel = compensate(compensation, shown(t, g), g);
      EXPECT_EQ(pixel.state, PixelState::kInGamut);
      EXPECT_LT((pixel.drive - t).norm(), kRounding) << "G " << g;
      const auto code = static_cast<std::uint16_t>(t.x() * 255);
      EXPECT_EQ(pixel.codes, (std::array<std::uint16_t, 3>{code, code, code}));
    }
  }
}

// Half of the white segment's light: without the residual in the gamut test it would be out of it.
TEST(ResidualCompensation, ReachesWhatOnlyTheSegmentCanSend) {
  const Compensation compensation(profile(), {});
  const CompensatedPixel pixel =
      compensate(compensation, shown(Vector3d::Constant(0.95), 1.0), 1.0);
  EXPECT_EQ(pixel.state, PixelState::kInGamut);
  // And a colour as bright as that, which it cannot.
  const Vector3d red_and_segment = Vector3d(1.2, 0.3, 0.3);
  const Xyz target = profile().surface *
                     (profile().primaries * red_and_segment + profile().black + profile().ambient);
  EXPECT_EQ(compensate(compensation, target, 1.0).state, PixelState::kOutOfGamut);
}

TEST(ResidualCompensation, MappedColoursKeepTheirHueAndCountTheirLoss) {
  const Compensation compensation(profile(), {});
  Pcg32 random(2);
  int mapped = 0;
  for (int i = 0; i < 4000; ++i) {
    const double g = 0.2 + random.uniform();
    const Vector3d t = 4.0 * random_drive(random) - Vector3d::Constant(1.0);
    const Xyz target = shown(t, g);
    if (target.minCoeff() < 0) continue;  // no light
    const CompensatedPixel pixel = compensate(compensation, target, g);
    ASSERT_GE(pixel.drive.minCoeff(), 0.0);
    ASSERT_LE(pixel.drive.maxCoeff(), 1.0);
    if (pixel.state != PixelState::kOutOfGamut) continue;
    ++mapped;
    const Ipt wanted = ipt_of(target);
    const Ipt got = ipt_of(shown(pixel.drive, g));
    // Within the table's error, which is 0.3 dE00 at most: about as many hundredths of IPT.
    constexpr double kTable = 0.3;
    ASSERT_NEAR(pixel.gamut_loss, 100 * (wanted - got).norm(), kTable) << target.transpose();
    // Off the line of equal hue by no more.
    const double chroma = wanted.tail<2>().norm();
    const double cross = wanted.y() * got.z() - wanted.z() * got.y();
    if (chroma > 0.02) {
      ASSERT_LT(100 * std::abs(cross) / chroma, kTable) << target.transpose();
    }
    ASSERT_LE(got.tail<2>().norm(), chroma + 0.01 * kTable);
    // No more than needed: the result touches the border of what the drive can do. The slope of the
    // drive over the chroma is steeper than without a residual.
    const double to_border =
        std::min(pixel.drive.minCoeff(), (Vector3d::Ones() - pixel.drive).minCoeff());
    ASSERT_LT(to_border, 0.02) << pixel.drive.transpose();
  }
  EXPECT_GT(mapped, 1000);
}

// Where no neutral can be shown at all, the drive is clamped, and the loss is about what is seen.
TEST(ResidualCompensation, ClampsWhereNoNeutralIsInReach) {
  auto p = profile();
  p.ambient = {60, 5, 1};  // red, and brighter than a dark surface needs
  const Compensation compensation(p, {});
  const CompensatedPixel pixel = compensate(compensation, {3, 3, 60}, 0.2);
  EXPECT_EQ(pixel.state, PixelState::kOutOfGamut);
  EXPECT_GE(pixel.drive.minCoeff(), 0.0);
  EXPECT_LE(pixel.drive.maxCoeff(), 1.0);
  EXPECT_TRUE(std::isfinite(pixel.gamut_loss));
  EXPECT_GT(pixel.gamut_loss, 1.0);
}

TEST(ResidualCompensation, OfZeroIsThatOfNone) {
  auto zero = profile();
  zero.residual = calibration::ColourResidual::sampled(
      3, [](const Vector3d&) -> Vector3d { return Vector3d::Zero(); });
  auto none = profile();
  none.residual = {};
  const Compensation with_zero(zero, {});
  const Compensation with_none(none, {});
  Pcg32 random(3);
  int mapped = 0;
  for (int i = 0; i < 2000; ++i) {
    const double g = 0.2 + random.uniform();
    const Xyz target = 60.0 * random_drive(random) * (i % 4);
    const CompensatedPixel a = compensate(with_zero, target, g);
    const CompensatedPixel b = compensate(with_none, target, g);
    ASSERT_EQ(a.state, b.state);
    // In gamut the same; mapped, the ends of the neutrals are found to a step of the search.
    const bool in = a.state == PixelState::kInGamut;
    ASSERT_LT((a.drive - b.drive).norm(), in ? 1e-10 : 5e-3) << target.transpose();
    const double allowed = in ? 0.0 : 0.05 + 2 * b.gamut_loss / (1 << kGamutSteps);
    ASSERT_NEAR(a.gamut_loss, b.gamut_loss, allowed) << target.transpose();
    mapped += in ? 0 : 1;
  }
  EXPECT_GT(mapped, 200);
}

TEST(ResidualCompensation, WhatIsNoNumberOrBelowTheFloorIsOutOfReach) {
  const Compensation compensation(profile(), {});
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const Xyz& target : {Xyz(kNan, 1, 1), Xyz(1, kInf, 1), Xyz(1, 1, -kInf)}) {
    const CompensatedPixel pixel = compensate(compensation, target, 1.0);
    EXPECT_EQ(pixel.state, PixelState::kOutOfReach);
    EXPECT_EQ(pixel.drive, Vector3d::Zero());
  }
  const double floor = RendererOptions{}.geometry_floor;
  const Xyz target = shown(Vector3d::Constant(0.5), floor);
  EXPECT_EQ(compensate(compensation, target, floor).state, PixelState::kInGamut);
  EXPECT_EQ(compensate(compensation, target, floor * (1 - 1e-12)).state, PixelState::kOutOfReach);
  EXPECT_EQ(compensate(compensation, target, 0.0).state, PixelState::kNotCovered);
  // Absurd but finite.
  const CompensatedPixel huge = compensate(compensation, {65504, 65504, 65504}, floor);
  EXPECT_EQ(huge.state, PixelState::kOutOfGamut);
  EXPECT_TRUE(huge.drive.allFinite());
}

}  // namespace
}  // namespace veneer::render
