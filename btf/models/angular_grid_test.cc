// SPDX-License-Identifier: Apache-2.0
#include "btf/models/angular_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "btf/elevated_concentric.h"
#include "btf/internal_test_sets.h"
#include "btf/models/concentric_square.h"

namespace veneer::btf {
namespace {

using testing::random_direction;

// The grid is filled in float.
constexpr double kFloatTolerance = 1e-5;

// What the grid draws, and what the reference gives, for values at the measured directions.
double drawn(const AngularGrid& grid, const Eigen::VectorXf& values, const Direction& direction) {
  const Eigen::VectorXf nodes = grid.fill() * values;
  const GridWeights weights = grid.weights(direction);
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) sum += weights.weight[i] * double(nodes[weights.node[i]]);
  return sum;
}

double interpolated(const SphericalInterpolator& reference,
                    const Eigen::VectorXf& values,
                    const Direction& direction) {
  const DirectionWeights weights = reference.weights(direction);
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) sum += weights.weight[i] * double(values[weights.index[i]]);
  return weights.scale * sum;
}

TEST(ConcentricSquare, StaysWithinItsStatedErrorOfTheExactMap) {
  Pcg32 random(1);
  double worst = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const Direction d = random_direction(random);
    worst =
        std::max(worst, (concentric_square(d) - square_from_direction(d)).cwiseAbs().maxCoeff());
  }
  EXPECT_LE(worst, kConcentricSquareError);
  EXPECT_GT(worst, 0.5 * kConcentricSquareError) << "the stated error is no bound but a guess";
}

TEST(ConcentricSquare, IsDefinedAtThePoleTheHorizonAndBelow) {
  EXPECT_EQ(concentric_square(Direction::UnitZ()), Eigen::Vector2d(0.5, 0.5));
  EXPECT_NEAR(concentric_square(Direction::UnitX()).x(), 1.0, 1e-12);
  EXPECT_NEAR(concentric_square(-Direction::UnitY()).y(), 0.0, 1e-12);
  const Direction diagonal = Direction(1.0, -1.0, 0.0).normalized();
  EXPECT_LT((concentric_square(diagonal) - Eigen::Vector2d(1.0, 0.0)).norm(), 1e-6);
  const Direction below = Direction(1.0, 0.3, -0.2).normalized();
  EXPECT_NEAR(concentric_square(below).x(), 1.0, 1e-12);
  EXPECT_TRUE(concentric_square(-Direction::UnitZ()).allFinite());
}

TEST(AngularGrid, WeightsSumToOneAndAreNotNegative) {
  const AngularGrid grid(bonn_directions(), DirectionRole::kView, 16);
  Pcg32 random(2);
  for (int i = 0; i < 10000; ++i) {
    const GridWeights weights = grid.weights(random_direction(random, -0.1));
    double sum = 0.0;
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_GE(weights.weight[j], -1e-12);
      EXPECT_GE(weights.node[j], 0);
      EXPECT_LT(weights.node[j], 256);
      sum += weights.weight[j];
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
}

TEST(AngularGrid, DrawsAConstantViewFunctionExactly) {
  const AngularGrid grid(bonn_directions(), DirectionRole::kView, 12);
  const Eigen::VectorXf ones = Eigen::VectorXf::Ones(81);
  Pcg32 random(3);
  for (int i = 0; i < 1000; ++i)
    EXPECT_NEAR(drawn(grid, ones, random_direction(random)), 1.0, kFloatTolerance);
}

TEST(AngularGrid, LightsAreDarkAtTheHorizon) {
  const AngularGrid grid(bonn_directions(), DirectionRole::kLight, 16);
  const Eigen::VectorXf ones = Eigen::VectorXf::Ones(81);
  for (int i = 0; i < 64; ++i) {
    const Direction horizon = direction_from_angles({std::acos(0.0), 0.1 * i});
    EXPECT_NEAR(drawn(grid, ones, horizon), 0.0, kFloatTolerance) << "azimuth " << 0.1 * i;
  }
}

TEST(AngularGrid, ComesCloserToTheReferenceWithMoreNodes) {
  // A smooth lobe and a cosine, as measured on the Bonn rings.
  const DirectionSet directions = bonn_directions();
  Eigen::VectorXf values(81);
  const Direction lobe = Direction(0.5, 0.2, 1.0).normalized();
  for (int i = 0; i < 81; ++i) {
    const Direction& d = directions[static_cast<std::size_t>(i)];
    values[i] = static_cast<float>(0.3 * d.z() + 0.7 * std::pow(std::max(0.0, d.dot(lobe)), 20.0));
  }
  for (const DirectionRole role : {DirectionRole::kView, DirectionRole::kLight}) {
    const SphericalInterpolator reference(directions, role);
    double last = 1.0;
    for (const int nodes : {8, 16, 32}) {
      const AngularGrid grid(directions, role, nodes);
      Pcg32 random(4);
      double error = 0.0;
      constexpr int kSamples = 2000;
      for (int i = 0; i < kSamples; ++i) {
        const Direction d = random_direction(random);
        error += std::abs(drawn(grid, values, d) - interpolated(reference, values, d)) / kSamples;
      }
      EXPECT_LT(error, 0.6 * last) << nodes << " nodes";
      last = error;
    }
    EXPECT_LT(last, 2e-3);
  }
}

TEST(AngularGrid, ABoxHasTheDensityOfTheWholeAndOneNodeWhereItIsAPoint) {
  const DirectionSet all = bonn_directions();
  const auto shape = [&](const DirectionBox& box) {
    const GridShape of = GridShape::of(all, DirectionRole::kLight, box, 16);
    return std::pair{of.columns, of.rows};
  };
  EXPECT_EQ(shape({}), std::pair(16, 16));
  EXPECT_EQ(shape({0.0, 0.5, 0.25, 0.5}), std::pair(8, 4));
  EXPECT_EQ(shape({0.2, 0.2008, 0.3, 0.31}), std::pair(1, 2));
  EXPECT_EQ(shape({0.4, 0.4, 0.7, 0.7}), std::pair(1, 1));
}

TEST(AngularGrid, APointHasTheReferencesValueThereWhateverIsAsked) {
  const DirectionSet directions = bonn_directions();
  const SphericalInterpolator reference(directions, DirectionRole::kLight);
  Eigen::VectorXf values(81);
  for (int i = 0; i < 81; ++i) values[i] = 0.1F + 0.01F * static_cast<float>(i);
  const Direction at = direction_from_angles({0.7, 2.0});
  const Eigen::Vector2d st = square_from_direction(at);
  const AngularGrid grid(
      directions,
      DirectionRole::kLight,
      GridShape::of(directions, DirectionRole::kLight, {st.x(), st.x(), st.y(), st.y()}, 16));
  EXPECT_EQ(grid.shape().count(), 1);
  Pcg32 random(8);
  for (int i = 0; i < 100; ++i)
    EXPECT_NEAR(drawn(grid, values, random_direction(random, -0.1)),
                interpolated(reference, values, at),
                kFloatTolerance);
}

TEST(AngularGrid, WeightsInABoxSumToOneAndOutsideItAreThoseOfItsBorder) {
  const DirectionSet directions = bonn_directions();
  for (const DirectionBox& box : {DirectionBox{0.5, 0.8, 0.2, 0.6},
                                  DirectionBox{0.5, 0.8, 0.4, 0.4},
                                  DirectionBox{0.0, 1.0, 0.0, 0.3}}) {
    const AngularGrid grid(
        directions, DirectionRole::kView, GridShape::of(directions, DirectionRole::kView, box, 12));
    EXPECT_TRUE(grid.fill().allFinite());
    const Eigen::VectorXf ones = Eigen::VectorXf::Ones(81);
    Pcg32 random(9);
    for (int i = 0; i < 1000; ++i) {
      const Direction d = random_direction(random, -0.1);
      EXPECT_NEAR(drawn(grid, ones, d), 1.0, kFloatTolerance);
      const GridWeights weights = grid.weights(d);
      for (std::size_t j = 0; j < 4; ++j) {
        EXPECT_GE(weights.weight[j], 0.0);
        EXPECT_LT(weights.node[j], grid.shape().count());
      }
    }
  }
}

TEST(AngularGrid, OneViewNeedsOneNode) {
  const AngularGrid grid({direction_from_angles({0.3, 1.0})}, DirectionRole::kView, 16);
  EXPECT_EQ(grid.shape().count(), 1);
  EXPECT_EQ(drawn(grid, Eigen::VectorXf::Constant(1, 0.25F), Direction::UnitX()), 0.25);
}

TEST(AngularGrid, FewOrOneSidedDirectionsAreDefined) {
  for (const int count : {1, 2, 3, 7}) {
    const DirectionSet all = bonn_directions();
    const DirectionSet some(all.end() - count, all.end());
    const AngularGrid grid(some, DirectionRole::kLight, 8);
    EXPECT_TRUE(grid.fill().allFinite()) << count << " directions";
    const SphericalInterpolator reference(some, DirectionRole::kLight);
    const Eigen::VectorXf ones = Eigen::VectorXf::Ones(count);
    // The reference is smooth here: a constant that fades with the cosine.
    EXPECT_NEAR(drawn(grid, ones, Direction::UnitZ()),
                interpolated(reference, ones, Direction::UnitZ()),
                0.05);
  }
}

}  // namespace
}  // namespace veneer::btf
