// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour_residual.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

constexpr double kRounding = 1e-13;  // of a few sums of numbers up to 1

Vector3d random_drive(Pcg32& random) {
  return {random.uniform(), random.uniform(), random.uniform()};
}

TEST(ColourResidual, IsExactForWhatIsLinearInTheRootsOfTheDrive) {
  Eigen::Matrix3d slope;
  slope << 0.1, -0.2, 0.3, 0.0, 0.5, -0.1, 0.2, 0.2, -0.4;
  const auto rho = [&slope](const Vector3d& t) -> Vector3d {
    return slope * t.cwiseSqrt() + Vector3d(0.01, 0.02, 0.03);
  };
  const ColourResidual residual = ColourResidual::sampled(5, rho);
  Pcg32 random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector3d t = random_drive(random);
    EXPECT_LT((residual(t) - rho(t)).norm(), kRounding) << t.transpose();
  }
}

TEST(ColourResidual, FollowsTheCreaseOfAWhiteSegment) {
  const auto rho = [](const Vector3d& t) -> Vector3d {
    return Vector3d::Constant(0.25 * std::sqrt(t.minCoeff()));
  };
  const ColourResidual residual = ColourResidual::sampled(3, rho);
  Pcg32 random(2);
  for (int i = 0; i < 200; ++i) {
    const Vector3d t = random_drive(random);
    EXPECT_LT((residual(t) - rho(t)).norm(), kRounding) << t.transpose();
  }
}

TEST(ColourResidual, StaysAtItsBorderBeyondTheCube) {
  const ColourResidual residual =
      ColourResidual::sampled(4, [](const Vector3d& t) -> Vector3d { return 0.1 * t; });
  EXPECT_LT((residual({2, -1, 0.5}) - residual({1, 0, 0.5})).norm(), kRounding);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_LT((residual({infinity, -infinity, 1}) - Vector3d(0.1, 0, 0.1)).norm(), kRounding);
  EXPECT_TRUE(residual({std::nan(""), 0, 0}).hasNaN());
  EXPECT_EQ(ColourResidual()({0.3, 0.4, 2}), Vector3d::Zero());
}

TEST(ColourResidual, IsContinuousAcrossCellsAndTetrahedra) {
  const ColourResidual residual = ColourResidual::sampled(3, [](const Vector3d& t) -> Vector3d {
    return {t.prod(), t.x() * t.y(), std::sin(9 * t.z())};
  });
  Pcg32 random(3);
  for (int i = 0; i < 100; ++i) {
    const Vector3d from = random_drive(random);
    const Vector3d to = random_drive(random);
    Vector3d last = residual(from);
    constexpr int kSteps = 2000;
    for (int k = 1; k <= kSteps; ++k) {
      const Vector3d next = residual(from + (to - from) * k / kSteps);
      // The steepest slope in sqrt(t) is about 9 / cell; the root is steep at 0 only.
      ASSERT_LT((next - last).norm(), 0.05) << from.transpose() << " to " << to.transpose();
      last = next;
    }
  }
}

}  // namespace
}  // namespace veneer::calibration
