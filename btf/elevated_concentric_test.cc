// SPDX-License-Identifier: Apache-2.0
#include "btf/elevated_concentric.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

// A handful of roundings; near the normal the square root of a difference is avoided, so no more.
constexpr double kRoundTrip = 1e-12;

TEST(ElevatedConcentric, RoundTripFromTheSquare) {
  Pcg32 random(1);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector2d st(random.uniform(), random.uniform());
    const Direction d = direction_from_square(st);
    EXPECT_NEAR(d.norm(), 1.0, kRoundTrip);
    EXPECT_LT((square_from_direction(d) - st).norm(), kRoundTrip) << st.transpose();
  }
}

TEST(ElevatedConcentric, RoundTripFromTheHemisphere) {
  Pcg32 random(2);
  for (int i = 0; i < 5000; ++i) {
    const Direction d = testing::random_direction(random);
    EXPECT_LT((direction_from_square(square_from_direction(d)) - d).norm(), kRoundTrip)
        << d.transpose();
  }
  for (const double theta : {1e-3, 1e-6, 1e-9, 1e-12}) {
    const Direction d = direction_from_angles({theta, 2.0});
    const Direction back = direction_from_square(square_from_direction(d));
    // Near the normal the square's own coordinates, about 0.5, round at 1e-16.
    EXPECT_LT((back - d).norm(), 1e-15 + kRoundTrip * theta) << theta;
  }
}

TEST(ElevatedConcentric, SpecialPoints) {
  EXPECT_EQ(direction_from_square({0.5, 0.5}), Direction::UnitZ());
  EXPECT_EQ(square_from_direction(Direction::UnitZ()), Eigen::Vector2d(0.5, 0.5));
  // Corners lie on the horizon's diagonals, middles of sides on its axes.
  const double half = std::sqrt(0.5);
  EXPECT_LT((direction_from_square({1, 1}) - Direction(half, half, 0)).norm(), kRoundTrip);
  EXPECT_LT((direction_from_square({0, 1}) - Direction(-half, half, 0)).norm(), kRoundTrip);
  EXPECT_LT((direction_from_square({0, 0}) - Direction(-half, -half, 0)).norm(), kRoundTrip);
  EXPECT_LT((direction_from_square({1, 0}) - Direction(half, -half, 0)).norm(), kRoundTrip);
  EXPECT_LT((direction_from_square({1, 0.5}) - Direction(1, 0, 0)).norm(), kRoundTrip);
  EXPECT_LT((direction_from_square({0.5, 0}) - Direction(0, -1, 0)).norm(), kRoundTrip);
  for (const Eigen::Vector2d& corner : {Eigen::Vector2d(0, 0), {0, 1}, {1, 0}, {1, 1}})
    EXPECT_LT((square_from_direction(direction_from_square(corner)) - corner).norm(), kRoundTrip);
}

TEST(ElevatedConcentric, OutsideTheSquareIsItsBorder) {
  EXPECT_EQ(direction_from_square({1.5, 0.3}), direction_from_square({1.0, 0.3}));
  EXPECT_EQ(direction_from_square({-1.0, 7.0}), direction_from_square({0.0, 1.0}));
}

TEST(ElevatedConcentric, BelowTheHorizonIsTheHorizonAtItsAzimuth) {
  Pcg32 random(3);
  for (int i = 0; i < 500; ++i) {
    const double phi = 2.0 * std::numbers::pi * random.uniform();
    const Eigen::Vector2d horizon =
        square_from_direction(direction_from_angles({std::numbers::pi / 2, phi}));
    const Eigen::Vector2d below = square_from_direction(
        direction_from_angles({std::numbers::pi * (0.501 + 0.49 * random.uniform()), phi}));
    EXPECT_LT((below - horizon).norm(), kRoundTrip) << phi;
  }
  EXPECT_EQ(square_from_direction(-Direction::UnitZ()), Eigen::Vector2d(1.0, 0.5));
}

// The area of a small quadrilateral on the sphere against that of its square: 2 pi to 1 everywhere.
TEST(ElevatedConcentric, PreservesArea) {
  constexpr double kStep = 1e-4;
  Pcg32 random(4);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d st(0.001 + 0.998 * random.uniform(), 0.001 + 0.998 * random.uniform());
    // Central differences are good only where the map is smooth: not across the diagonals.
    const Eigen::Vector2d ab = (2.0 * st).array() - 1.0;
    if (std::abs(std::abs(ab.x()) - std::abs(ab.y())) < 4.0 * kStep) continue;
    const Eigen::Vector2d ds(kStep, 0.0);
    const Eigen::Vector2d dt(0.0, kStep);
    const Direction u =
        (direction_from_square(st + ds) - direction_from_square(st - ds)) / (2.0 * kStep);
    const Direction v =
        (direction_from_square(st + dt) - direction_from_square(st - dt)) / (2.0 * kStep);
    const double squeeze = std::sqrt(1.0 / std::max(1.0 - ab.cwiseAbs().maxCoeff(), kStep));
    EXPECT_NEAR(u.cross(v).norm() / (2.0 * std::numbers::pi), 1.0, 1e-3 * squeeze)
        << st.transpose();
  }
}

TEST(ElevatedConcentric, IsContinuousAcrossTheDiagonalsAndTheCentre) {
  constexpr double kStep = 1e-7;
  // Steepest near the border, where theta grows as the square root of what is left: there by
  // sqrt(2 * kStep); inside, by a small factor.
  Pcg32 random(5);
  for (int i = 0; i < 4000; ++i) {
    const double t = 0.01 + 0.98 * random.uniform();
    const Eigen::Vector2d diagonal =
        i % 2 == 0 ? Eigen::Vector2d(t, t) : Eigen::Vector2d(t, 1.0 - t);
    const Direction at = direction_from_square(diagonal);
    for (const Eigen::Vector2d& step :
         {Eigen::Vector2d(kStep, 0), {-kStep, 0}, {0, kStep}, {0, -kStep}})
      EXPECT_LT((direction_from_square(diagonal + step) - at).norm(), 20.0 * kStep)
          << diagonal.transpose();
  }
  EXPECT_LT((direction_from_square({0.5 + kStep, 0.5 - kStep}) - Direction::UnitZ()).norm(),
            10.0 * kStep);
}

}  // namespace
}  // namespace veneer::btf
