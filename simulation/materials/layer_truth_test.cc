// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/layer_truth.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "simulation/materials/body_materials.h"

namespace veneer::simulation {
namespace {

constexpr int kSize = 32;

double covered(const LayerTruth& truth, std::size_t layer) {
  double sum = 0.0;
  for (std::size_t texel = 0; texel < kSize * kSize; ++texel)
    sum += truth.occupancy[layer * kSize * kSize + texel];
  return sum / (kSize * kSize);
}

TEST(LayerTruth, OfASphereIsItsSlicesAndTheNormalsOfItsUpperHalf) {
  BodyField field;
  field.resolution = kSize;
  const Eigen::Vector3d middle(0.5, 0.5, 0.3);
  constexpr double kRadius = 0.25;
  field.bodies = {sphere(middle, kRadius)};
  field.surface_at = [](const Eigen::Vector3d&, int) { return Surface{}; };
  const std::array heights{0.6, 0.3, 0.0};  // slices end at 0.45 and 0.15
  const LayerTruth truth = layer_truth(field, kSize, heights);
  // Places of 1/256 along a circle of a circumference of up to 1.6: far under 1/256.
  const double cap = kRadius * kRadius - 0.15 * 0.15;
  EXPECT_NEAR(covered(truth, 0), std::numbers::pi * cap, 2e-3);
  EXPECT_NEAR(covered(truth, 1), std::numbers::pi * kRadius * kRadius, 2e-3);
  EXPECT_EQ(covered(truth, 2), 1.0);

  // Half its radius from the axis, towards each side.
  const std::size_t middle_layer = 1 * kSize * kSize;
  const auto at = [&](int column, int row) {
    return truth.normals[middle_layer + static_cast<std::size_t>(row * kSize + column)];
  };
  EXPECT_GT(at(20, 16).x(), 0.4F);
  EXPECT_LT(at(11, 16).x(), -0.4F);
  EXPECT_LT(at(16, 20).y(), -0.4F);  // rows grow towards -y
  EXPECT_GT(at(16, 11).y(), 0.4F);
  const double x = (20.5 / kSize - 0.5) / kRadius;
  const double y = -(16.5 / kSize - 0.5) / kRadius;
  const Eigen::Vector3d expected(x, y, std::sqrt(1.0 - x * x - y * y));
  EXPECT_LT((at(20, 16).cast<double>() - expected).norm(), 0.01);
  EXPECT_EQ(at(1, 1).norm(), 0.0F);                                // nothing there
  EXPECT_NEAR(truth.normals[2 * kSize * kSize].z(), 1.0F, 1e-6F);  // the ground in a corner
}

TEST(LayerTruth, OfBarsIsTheirSharesOfTheTile) {
  const BodyMaterial* const bars = find_body_material("bars");
  ASSERT_NE(bars, nullptr);
  for (const std::uint64_t seed : {1U, 2U}) {
    const LayerTruth truth = layer_truth(bars->make(kSize, seed), kSize, bars->heights);
    // Two bars of 0.18 tile widths; places are 1/256 apart.
    for (std::size_t layer : {0U, 1U}) EXPECT_NEAR(covered(truth, layer), 0.36, 4.0 / 256.0);
    for (std::size_t i = 0; i < 2 * kSize * kSize; ++i)
      EXPECT_TRUE(truth.occupancy[i] < 0.99F || truth.normals[i].z() > 0.98F) << i;
  }
}

}  // namespace
}  // namespace veneer::simulation
