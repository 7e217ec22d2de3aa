// SPDX-License-Identifier: Apache-2.0
#include "calibration/drive_correction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/colour.h"
#include "base/random.h"
#include "base/result.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;
using Rho = std::function<Vector3d(const Vector3d&)>;

struct Defect {
  std::string name;
  Rho rho;
};

// What a projector's colour strays by, in its linear drive.
// A clear segment of a quarter of the light, lit by what the channels have in common, slightly
// blue.
Vector3d white_segment(const Vector3d& t) { return t.minCoeff() * Vector3d(0.24, 0.25, 0.27); }
// Each channel loses 5 % to the others where they are lit too: a supply that they share.
Vector3d crosstalk(const Vector3d& t) {
  return -0.05 *
         Vector3d(t.x() * (t.y() + t.z()), t.y() * (t.x() + t.z()), t.z() * (t.x() + t.y())) / 2;
}
// The primaries move by 6 % over their ramp: light of the other channels that is there in the dark.
Vector3d drift(const Vector3d& t) {
  const auto hump = [](double x) { return 4.0 * x * (1.0 - x); };
  return 0.06 * Vector3d(hump(t.y()), hump(t.z()), -0.5 * hump(t.x()) + hump(t.z())) / 2;
}
std::vector<Defect> defects() {
  return {{"white_segment", white_segment},
          {"crosstalk", crosstalk},
          {"drift", drift},
          {"all_three", [](const Vector3d& t) -> Vector3d {
             return white_segment(t) + crosstalk(t) + drift(t);
           }}};
}

constexpr int kResidualNodes = 17;

Vector3d random_drive(Pcg32& random, double from = 0.0, double to = 1.0) {
  const auto value = [&] { return std::lerp(from, to, random.uniform()); };
  const double r = value();
  const double g = value();
  return {r, g, value()};
}

TEST(SolveDrive, FindsTheDriveOfEveryColourInReach) {
  Pcg32 random(3);
  for (const Defect& defect : defects()) {
    const auto rho = ColourResidual::sampled(kResidualNodes, defect.rho);
    for (int i = 0; i < 3000; ++i) {
      const Vector3d t = random_drive(random);
      // In the first cell of the grid t + rho(t) may fall before it rises: see solve_drive.
      const double tolerance = t.minCoeff() < 1.0 / 256 ? 1e-5 : 1e-9;
      const Vector3d wanted = t + rho(t);
      const Vector3d found = solve_drive(rho, wanted);
      ASSERT_LT((found + rho(found) - wanted).norm(), tolerance)
          << defect.name << " at " << t.transpose();
      ASSERT_LT((found - t).norm(), 1e-2) << defect.name << " at " << t.transpose();
    }
  }
}

TEST(SolveDrive, LeavesTheCubeExactlyWhereTheColourIsOutOfReach) {
  Pcg32 random(4);
  for (const Defect& defect : defects()) {
    const auto rho = ColourResidual::sampled(kResidualNodes, defect.rho);
    for (int i = 0; i < 1000; ++i) {
      Vector3d outside = random_drive(random, 0.05, 0.95);
      const auto channel = static_cast<Eigen::Index>(random.next() % 3);
      outside[channel] =
          random.next() % 2 == 0 ? 1.02 + random.uniform() : -0.02 - random.uniform();
      const Vector3d found = solve_drive(rho, outside + rho(outside));
      ASSERT_LT((found - outside).norm(), 1e-7) << defect.name << " at " << outside.transpose();
    }
  }
}

TEST(SolveDrive, StaysFiniteAndNearWhereNoDriveExists) {
  Pcg32 random(5);
  const std::vector<Defect> hostile{
      {"all black", [](const Vector3d& t) -> Vector3d { return -t; }},
      {"turned over", [](const Vector3d& t) -> Vector3d { return -2.0 * t; }},
      {"swapped", [](const Vector3d& t) { return Vector3d(t.y() - t.x(), t.x() - t.y(), 0.0); }},
      {"waves", [](const Vector3d& t) -> Vector3d { return (40.0 * t).array().sin().matrix(); }},
      {"noise", [&random](const Vector3d&) { return random_drive(random, -5.0, 5.0); }}};
  for (const Defect& defect : hostile) {
    const auto rho = ColourResidual::sampled(9, defect.rho);
    double most = 0;
    for (const Vector3d& value : rho.values()) most = std::max(most, value.cwiseAbs().maxCoeff());
    for (int i = 0; i < 300; ++i) {
      const Vector3d wanted = random_drive(random, -1.0, 2.0);
      const Vector3d found = solve_drive(rho, wanted);
      ASSERT_TRUE(found.allFinite()) << defect.name << " at " << wanted.transpose();
      ASSERT_LE((found - wanted).cwiseAbs().maxCoeff(), most + 1e-12)
          << defect.name << " at " << wanted.transpose();
      // Never worse than to ask for what is wanted.
      ASSERT_LE((found + rho(found) - wanted).norm(), rho(wanted).norm()) << defect.name;
    }
    const DriveCorrection correction(rho, 5);
    for (const Vector3d& value : correction.values()) ASSERT_TRUE(value.allFinite());
  }
}

TEST(DriveCorrection, OfNoResidualChangesNothing) {
  const DriveCorrection none{ColourResidual()};
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(none(Vector3d(0.3, -2.0, 7.0)), Vector3d(0.3, -2.0, 7.0));
}

// sRGB-like primaries with a white of 200 cd/m^2.
Eigen::Matrix3d primaries() { return 200.0 * xyz_from_srgb(); }

TEST(DriveCorrection, MeetsTargetsWithinWhatNobodySees) {
  constexpr double kMean = 0.05;
  constexpr double kMost = 0.3;
  Pcg32 random(6);
  for (const Defect& defect : defects()) {
    const auto rho = ColourResidual::sampled(kResidualNodes, defect.rho);
    const DriveCorrection correction(rho);
    const Xyz white = primaries() * (Vector3d::Ones() + rho(Vector3d::Ones()));
    double sum = 0;
    double most = 0;
    Vector3d worst = Vector3d::Zero();
    constexpr int kTargets = 20000;
    for (int i = 0; i < kTargets; ++i) {
      // Half of them dark: evenly spread in about L*.
      Vector3d t = random_drive(random);
      if (i % 2 == 0) t = t.array().pow(2.4).matrix();
      const Vector3d wanted = t + rho(t);
      const Vector3d tau = correction(wanted).cwiseMax(0.0).cwiseMin(1.0);
      const double difference = delta_e_2000(lab_from_xyz(primaries() * wanted, white),
                                             lab_from_xyz(primaries() * (tau + rho(tau)), white));
      sum += difference;
      if (difference > most) {
        most = difference;
        worst = t;
      }
    }
    EXPECT_LT(sum / kTargets, kMean) << defect.name;
    EXPECT_LT(most, kMost) << defect.name << " at " << worst.transpose();
    RecordProperty(defect.name, fmt::format("mean {:.4f}, max {:.4f}", sum / kTargets, most));
  }
}

// t* of a node along an axis.
Vector3d wanted_at(const DriveCorrection& correction, int r, int g, int b) {
  const DriveCorrection::Axes& axes = correction.axes();
  Vector3d s = Eigen::Vector3i(r, g, b).cast<double>();
  s = (s.array() - axes.below) / axes.steps;
  return axes.full.cwiseProduct(s.cwiseProduct(s.cwiseAbs()));
}

TEST(DriveCorrection, CoversAllThatTheProjectorCanSend) {
  for (const Defect& defect : defects()) {
    const auto rho = ColourResidual::sampled(kResidualNodes, defect.rho);
    const DriveCorrection correction(rho);
    const int last = correction.nodes() - 1;
    const Vector3d lowest = wanted_at(correction, 0, 0, 0);
    const Vector3d highest = wanted_at(correction, last, last, last);
    Pcg32 random(8);
    for (int i = 0; i < 3000; ++i) {
      Vector3d t = random_drive(random, -0.2, 1.2).cwiseMax(0.0).cwiseMin(1.0);
      t += rho(t);
      ASSERT_TRUE((t.array() >= lowest.array() - 1e-9).all()) << defect.name << t.transpose();
      ASSERT_TRUE((t.array() <= highest.array() + 1e-9).all()) << defect.name << t.transpose();
    }
    EXPECT_GE(correction.axes().steps, DriveCorrection::kNodes * 2 / 3) << defect.name;
  }
}

TEST(DriveCorrection, GoesOnBeyondItsGrid) {
  Pcg32 random(7);
  const auto rho = ColourResidual::sampled(kResidualNodes, defects().back().rho);
  const DriveCorrection correction(rho);
  const int last = correction.nodes() - 1;
  const Vector3d lowest = wanted_at(correction, 0, 0, 0);
  const Vector3d highest = wanted_at(correction, last, last, last);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d wanted = random_drive(random, -1.0, 3.0);
    const Vector3d nearest = wanted.cwiseMax(lowest).cwiseMin(highest);
    const Vector3d expected = wanted + correction(nearest) - nearest;
    ASSERT_LT((correction(wanted) - expected).norm(), 1e-12) << wanted.transpose();
  }
}

TEST(DriveCorrection, IsExactAtItsNodes) {
  const auto rho = ColourResidual::sampled(kResidualNodes, defects().back().rho);
  const DriveCorrection correction(rho, 9);
  for (int b = 0; b < 9; ++b) {
    for (int r = 0; r < 9; ++r) {
      const Vector3d wanted = wanted_at(correction, r, 4, b);
      EXPECT_LT((correction(wanted) - solve_drive(rho, wanted)).norm(), 1e-9) << r << ", " << b;
    }
  }
}

TEST(DriveCorrection, MeetsBlackAndFullDriveExactly) {
  for (const Defect& defect : defects()) {
    const auto rho = ColourResidual::sampled(kResidualNodes, defect.rho);
    const DriveCorrection correction(rho);
    EXPECT_LT(correction(Vector3d::Zero()).norm(), 1e-9) << defect.name;
    const Vector3d full = correction(Vector3d::Ones() + rho(Vector3d::Ones()));
    EXPECT_LT((full - Vector3d::Ones()).norm(), 1e-9) << defect.name << ": " << full.transpose();
  }
}

TEST(DriveCorrection, OfNaNIsNaN) {
  const DriveCorrection correction(ColourResidual::sampled(5, white_segment), 5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(correction(Vector3d(0.1, nan, 0.2)).hasNaN());
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(correction(Vector3d(infinity, 0.0, 0.0)).x(), infinity);
}

}  // namespace
}  // namespace veneer::calibration
