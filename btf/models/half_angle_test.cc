// SPDX-License-Identifier: Apache-2.0
#include "btf/models/half_angle.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

using half_angle::coordinates;
using half_angle::kNodes;
using half_angle::weights;
using testing::random_direction;
using testing::ring;

// Squares of sines near the poles, by which coordinates divide: double leaves this much.
constexpr double kRounding = 1e-9;

Direction turned(const Direction& d, double angle) {
  return Eigen::AngleAxisd(angle, Direction::UnitZ()) * d;
}
Direction mirrored(const Direction& d) { return {d.x(), -d.y(), d.z()}; }

// g at a pair, from random values at the nodes.
double at(const std::vector<double>& nodes, const Direction& view, const Direction& light) {
  const half_angle::NodeWeights place = weights(view, light);
  double sum = 0;
  for (std::size_t i = 0; i < 8; ++i)
    sum += place.weight[i] * nodes[static_cast<std::size_t>(place.node[i])];
  return sum;
}

std::vector<double> random_nodes(Pcg32& random) {
  std::vector<double> nodes(kNodes);
  for (double& node : nodes) node = random.uniform();
  return nodes;
}

// A lobe of any width under 1 over the grid, of other heights at other angles.
RowMatrix lobe_nodes(Pcg32& random) {
  const double width = 5 + 40 * random.uniform();
  const double rise = random.uniform();
  const double turn = random.uniform() - 0.5;
  RowMatrix nodes(1, kNodes);
  for (int node = 0; node < kNodes; ++node) {
    const double u = double(node % half_angle::kHalfNodes) / (half_angle::kHalfNodes - 1);
    const double v = double(node / half_angle::kHalfNodes % half_angle::kDifferenceNodes) /
                     (half_angle::kDifferenceNodes - 1);
    const double w = double(node / half_angle::kHalfNodes / half_angle::kDifferenceNodes) /
                     (half_angle::kAzimuthNodes - 1);
    nodes(0, node) =
        static_cast<float>(std::exp(-width * u * u) * (0.5 + 0.5 * rise * v + turn * u * v * w));
  }
  return nodes;
}

TEST(HalfAngle, IsIsotropicReciprocalAndMirrorSymmetric) {
  Pcg32 random(1);
  const std::vector<double> nodes = random_nodes(random);
  for (int i = 0; i < 5000; ++i) {
    const Direction view = random_direction(random);
    const Direction light = random_direction(random);
    const double turn = 7 * random.uniform();
    const double here = at(nodes, view, light);
    EXPECT_NEAR(here, at(nodes, light, view), kRounding);
    EXPECT_NEAR(here, at(nodes, turned(view, turn), turned(light, turn)), kRounding);
    EXPECT_NEAR(here, at(nodes, mirrored(view), mirrored(light)), kRounding);
  }
}

// By angles, the long way.
TEST(HalfAngle, CoordinatesAreRusinkiewiczs) {
  Pcg32 random(2);
  for (int i = 0; i < 2000; ++i) {
    const Direction view = random_direction(random);
    const Direction light = random_direction(random);
    const Direction half = (view + light).normalized();
    const double theta_h = std::acos(half.z());
    const double theta_d = std::acos(std::min(1.0, half.dot(light)));
    const double phi_h = std::atan2(half.y(), half.x());
    const Direction difference = Eigen::AngleAxisd(-theta_h, Direction::UnitY()) *
                                 (Eigen::AngleAxisd(-phi_h, Direction::UnitZ()) * light);
    const double cosine = std::cos(std::atan2(difference.y(), difference.x()));
    const Eigen::Vector3d wanted(std::sqrt(2.0) * std::sin(theta_h / 2),
                                 std::sqrt(2.0) * std::sin(theta_d / 2),
                                 cosine * cosine);
    EXPECT_LT((coordinates(view, light) - wanted).norm(), 1e-6);  // of acos near 1
  }
}

TEST(HalfAngle, PolesAndTheHorizonHaveAPlace) {
  const Direction normal = Direction::UnitZ();
  const Direction grazing = Direction::UnitX();
  const Direction low = Direction(1.0, 0.0, 1e-9).normalized();
  EXPECT_EQ(coordinates(normal, normal), Eigen::Vector3d::Zero());
  for (const auto& [view, light] : {std::pair{normal, normal},
                                    {normal, grazing},
                                    {grazing, grazing},
                                    {grazing, Direction(-grazing)},
                                    {low, Direction(-1.0, 0.0, 1e-12)},
                                    {Direction(0.8, 0.0, -0.6), normal},
                                    {Direction(0.0, 0.0, -1.0), low}}) {
    const Eigen::Vector3d place = coordinates(view, light);
    EXPECT_TRUE(place.allFinite()) << view.transpose() << ", " << light.transpose();
    EXPECT_GE(place.minCoeff(), 0.0);
    EXPECT_LE(place.maxCoeff(), 1.0);
    double sum = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const half_angle::NodeWeights found = weights(view, light);
      ASSERT_GE(found.node[i], 0);
      ASSERT_LT(found.node[i], kNodes);
      ASSERT_GE(found.weight[i], 0.0);
      sum += found.weight[i];
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
}

// Near a pole the azimuth turns at will; what is drawn may not.
TEST(HalfAngle, DoesNotTearAtItsPoles) {
  Pcg32 random(3);
  const std::vector<double> nodes = random_nodes(random);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 1000; ++i) {
    const Direction light = random_direction(random, 0.1);
    const Direction mirror(-light.x(), -light.y(), light.z());
    const auto beside = [&](const Direction& d) {
      return Direction((d + kStep * random_direction(random, -1.0)).normalized());
    };
    // Half vector at the normal; view at the light. A node is 1/31 wide at least.
    EXPECT_NEAR(at(nodes, beside(mirror), light), at(nodes, mirror, light), 200 * kStep);
    EXPECT_NEAR(at(nodes, beside(light), light), at(nodes, light, light), 200 * kStep);
  }
}

TEST(HalfAngle, FillRecoversWhatItsNodesMade) {
  Pcg32 random(4);
  for (const auto& [views, lights] : {std::pair{bonn_directions(), bonn_directions()},
                                      {ring(6, 1.0), ring(7, 1.1)},
                                      {DirectionSet{Direction::UnitZ()}, bonn_directions()},
                                      {bonn_directions(), ring(0, 0.0)}}) {
    RowMatrix nodes(3, kNodes);
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) nodes.row(i) = lobe_nodes(random);
    const RowMatrix made = half_angle::values_at(views, lights, nodes);
    const RowMatrix again =
        half_angle::values_at(views, lights, half_angle::fill(views, lights, made));
    // A pull towards evenness of 1e-3 of a pair's weight, which shows where few pairs tell a node.
    EXPECT_LT((made - again).cwiseAbs().maxCoeff(), 1e-2F);
    EXPECT_LT((made - again).norm(), 5e-3F * made.norm());
  }
}

// What no pair tells is as bright as what is next to it, and nothing is made of nothing.
TEST(HalfAngle, FillStaysWithinTheData) {
  const DirectionSet directions = bonn_directions();
  RowMatrix nodes(2, kNodes);
  nodes.row(0).setZero();
  nodes.row(1).setConstant(0.7F);
  const RowMatrix filled = half_angle::fill(
      directions, directions, half_angle::values_at(directions, directions, nodes));
  EXPECT_EQ(filled.row(0).cwiseAbs().maxCoeff(), 0.0F);
  EXPECT_LT((filled.row(1).array() - 0.7F).abs().maxCoeff(), 1e-4F);
  // A light on the horizon tells nothing of g.
  const DirectionSet horizon{Direction::UnitX()};
  const RowMatrix dark = half_angle::fill(directions, horizon, RowMatrix::Zero(1, 81));
  EXPECT_EQ(dark.cwiseAbs().maxCoeff(), 0.0F);
}

TEST(HalfAngle, EveryNodeOfEveryClusterHasATexelWithinWhatGpusTake) {
  for (const int clusters : {1, 3, 32, 64, 65, 256}) {
    const half_angle::Volume volume(clusters);
    EXPECT_LE(volume.width(), 2048);
    EXPECT_LE(volume.height(), 2048);
    std::vector<bool> taken(volume.texel_count());
    for (int k = 0; k < clusters; ++k)
      for (int node = 0; node < kNodes; ++node) {
        const std::size_t texel = volume.texel(k, node);
        ASSERT_LT(texel, taken.size());
        ASSERT_FALSE(taken[texel]);
        taken[texel] = true;
      }
  }
}

}  // namespace
}  // namespace veneer::btf
