// SPDX-License-Identifier: Apache-2.0
#include "calibration/interpolation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/random.h"

namespace veneer::calibration {
namespace {

constexpr double kRounding = 1e-12;  // a few ulp of values near 1

std::vector<double> random_knots(Pcg32& random, int count) {
  std::vector<double> x{0.0};
  for (int i = 1; i < count; ++i) x.push_back(x.back() + 0.05 + random.uniform());
  return x;
}

TEST(CubicHermite, PassesThroughItsKnots) {
  Pcg32 random(1);
  for (const Slopes slopes : {Slopes::kSmooth, Slopes::kMonotone}) {
    const std::vector<double> x = random_knots(random, 12);
    std::vector<double> y(12);
    for (double& value : y) value = random.uniform();
    const CubicHermite curve(x, y, slopes);
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(curve(x[i]), y[i], kRounding) << i;
  }
}

TEST(CubicHermite, SmoothSlopesReproduceEveryParabola) {
  Pcg32 random(2);
  const std::vector<double> x = random_knots(random, 8);
  const auto parabola = [](double t) { return 0.3 - 0.7 * t + 0.21 * t * t; };
  std::vector<double> y;
  for (const double knot : x) y.push_back(parabola(knot));
  const CubicHermite curve(x, y, Slopes::kSmooth);
  for (double t = x.front(); t <= x.back(); t += 0.01)
    EXPECT_NEAR(curve(t), parabola(t), kRounding * 10) << t;
}

TEST(CubicHermite, MonotoneSlopesNeverFallBetweenRisingKnots) {
  Pcg32 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<double> x = random_knots(random, 10);
    // Steps of very different height, flat ones among them, are what makes cubics overshoot.
    std::vector<double> y{0.0};
    for (int i = 1; i < 10; ++i)
      y.push_back(y.back() + (i % 3 == 0 ? 0.0 : std::pow(random.uniform(), 6)));
    const CubicHermite curve(x, y, Slopes::kMonotone);
    double previous = curve(x.front());
    for (double t = x.front(); t <= x.back(); t += 0.003) {
      EXPECT_GE(curve(t), previous - kRounding) << "trial " << trial << " at " << t;
      previous = curve(t);
    }
  }
}

TEST(CubicHermite, ContinuesStraightBeyondItsKnots) {
  const CubicHermite line({1.0, 2.0}, {3.0, 5.0}, Slopes::kMonotone);
  EXPECT_NEAR(line(0.0), 1.0, kRounding);
  EXPECT_NEAR(line(4.0), 9.0, kRounding);
}

TEST(CubicHermite, SlopeIsTheDerivativeInsideAndBeyond) {
  Pcg32 random(5);
  const std::vector<double> x = random_knots(random, 10);
  std::vector<double> y(10);
  for (double& value : y) value = random.uniform();
  for (const Slopes slopes : {Slopes::kSmooth, Slopes::kMonotone}) {
    const CubicHermite curve(x, y, slopes);
    constexpr double kStep = 1e-5;
    constexpr double kDifference = 1e-6;  // the quotient's error: step^2, rounding / step
    for (double t = x.front() - 0.3; t < x.back() + 0.3; t += 0.0137)
      EXPECT_NEAR(
          curve.slope_at(t), (curve(t + kStep) - curve(t - kStep)) / (2 * kStep), 1e3 * kStep)
          << t;
    for (double t = x.front() + 0.01; t < x.front() + 0.04; t += 0.007)
      EXPECT_NEAR(
          curve.slope_at(t), (curve(t + kStep) - curve(t - kStep)) / (2 * kStep), kDifference)
          << t;
  }
}

TEST(CubicHermite, SmoothSlopesAreLinearInTheValues) {
  Pcg32 random(6);
  const std::vector<double> x = random_knots(random, 10);
  std::vector<double> a(10);
  std::vector<double> b(10);
  std::vector<double> mixed(10);
  for (std::size_t i = 0; i < 10; ++i) {
    a[i] = random.normal();
    b[i] = random.normal();
    mixed[i] = 0.3 * a[i] - 2.0 * b[i];
  }
  const CubicHermite of_a(x, a, Slopes::kSmooth);
  const CubicHermite of_b(x, b, Slopes::kSmooth);
  const CubicHermite of_mixed(x, mixed, Slopes::kSmooth);
  for (double t = -0.5; t <= x.back() + 0.5; t += 0.01)
    EXPECT_NEAR(of_mixed(t), 0.3 * of_a(t) - 2.0 * of_b(t), 100 * kRounding) << t;
}

TEST(PiecewiseLinear, IsStraightBetweenKnotsAndGoesOnBeyond) {
  const PiecewiseLinear line({0.0, 1.0, 3.0}, {0.0, 2.0, 3.0});
  EXPECT_NEAR(line(0.25), 0.5, kRounding);
  EXPECT_NEAR(line(1.0), 2.0, kRounding);
  EXPECT_NEAR(line(2.0), 2.5, kRounding);
  EXPECT_NEAR(line(-1.0), -2.0, kRounding);
  EXPECT_NEAR(line(5.0), 4.0, kRounding);
  EXPECT_NEAR(line.slope_at(-1.0), 2.0, kRounding);
  EXPECT_NEAR(line.slope_at(1.0), 0.5, kRounding);
  EXPECT_NEAR(line.slope_at(9.0), 0.5, kRounding);
  EXPECT_TRUE(std::isnan(line(std::nan(""))));
}

TEST(NearestRising, LeavesRisingSequencesAlone) {
  const std::vector<double> rising{-1.0, 0.0, 0.0, 2.5};
  EXPECT_EQ(nearest_rising(rising), rising);
  EXPECT_TRUE(nearest_rising({}).empty());
}

TEST(NearestRising, RisesKeepsTheMeanAndIsNearerThanItsNeighbours) {
  Pcg32 random(4);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> values(30);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = 0.05 * static_cast<double>(i) + random.normal();
    const std::vector<double> rising = nearest_rising(values);
    ASSERT_EQ(rising.size(), values.size());
    EXPECT_TRUE(std::ranges::is_sorted(rising));
    EXPECT_NEAR(std::accumulate(rising.begin(), rising.end(), 0.0),
                std::accumulate(values.begin(), values.end(), 0.0),
                1e-10);  // rounding of 30 sums
    const auto distance = [&](const std::vector<double>& other) {
      double sum = 0;
      for (std::size_t i = 0; i < values.size(); ++i) sum += std::pow(other[i] - values[i], 2);
      return sum;
    };
    for (int neighbour = 0; neighbour < 20; ++neighbour) {
      std::vector<double> other = rising;
      for (double& value : other) value += 0.01 * random.normal();
      std::ranges::sort(other);
      EXPECT_GE(distance(other), distance(rising) - kRounding);
    }
  }
}

}  // namespace
}  // namespace veneer::calibration
