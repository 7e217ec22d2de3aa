// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "simulation/materials/synthesize.h"

namespace veneer::simulation {
namespace {

constexpr int kSize = 16;

TEST(Materials, AreFoundByNameAndOthersAreNot) {
  for (const auto& material : height_field_materials()) {
    const auto found = find_height_field_material(material.name);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ((*found)->name, material.name);
  }
  const auto none = find_height_field_material("granite");
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, Errc::kInvalidOption);
  EXPECT_THAT(none.error().what,
              testing::HasSubstr("cloth, corrugated, corrugated-print, hammered, leather, plaster"));
}

TEST(Materials, AreValidAtEverySize) {
  for (const auto& material : height_field_materials()) {
    for (const int size : {1, 7, kSize}) {
      const HeightField field = material.make(size, 1);
      EXPECT_EQ(field.resolution, size * kCellsPerTexel);
      const Status status = field.check();
      EXPECT_TRUE(status.has_value())
          << material.name << ' ' << size << ": " << status.error().what;
    }
  }
}

// A seam would stand out as a line of large steps; single steps are large wherever a ridge happens
// to be, so whole lines are compared.
TEST(Materials, RepeatWithoutASeam) {
  for (const auto& material : height_field_materials()) {
    const HeightField field = material.make(kSize, 1);
    const int n = field.resolution;
    const auto height = [&](int column, int row) {
      return field.heights[static_cast<std::size_t>((row % n) * n + column % n)];
    };
    for (const bool across : {true, false}) {
      std::vector<double> steps(static_cast<std::size_t>(n), 0.0);  // of each line to the next
      for (int line = 0; line < n; ++line) {
        for (int i = 0; i < n; ++i) {
          const float step = across ? height(line + 1, i) - height(line, i)
                                    : height(i, line + 1) - height(i, line);
          steps[static_cast<std::size_t>(line)] += std::abs(step);
        }
      }
      const double at_seam = steps.back();
      steps.pop_back();
      EXPECT_LE(at_seam, 1.1 * *std::ranges::max_element(steps))
          << material.name << (across ? " columns" : " rows");
    }
  }
}

TEST(Materials, AreTheSameTileAtTwiceTheSize) {
  for (const auto& material : height_field_materials()) {
    const HeightField coarse = material.make(kSize, 4);
    const HeightField fine = material.make(2 * kSize, 4);
    for (int row = 0; row < coarse.resolution; ++row) {
      for (int column = 0; column < coarse.resolution; ++column) {
        EXPECT_EQ(coarse.heights[static_cast<std::size_t>(row * coarse.resolution + column)],
                  fine.heights[static_cast<std::size_t>(2 * row * fine.resolution + 2 * column)])
            << material.name;
      }
    }
  }
}

TEST(Materials, DependOnTheSeedAndOnNothingElse) {
  for (const auto& material : height_field_materials()) {
    const auto values_of = [&](std::uint64_t seed) {
      std::vector<float> values = material.make(kSize, seed).heights;
      for (const Surface& surface : material.make(kSize, seed).surfaces)
        values.push_back(surface.albedo[0]);
      return values;
    };
    EXPECT_EQ(values_of(1), values_of(1)) << material.name;
    EXPECT_NE(values_of(1), values_of(2)) << material.name;
  }
}

TEST(Cloth, HasTwoThreadColoursInEqualParts) {
  const HeightField field = (*find_height_field_material("cloth"))->make(32, 1);
  std::size_t cream = 0;
  double light = 0.0;
  double dark = 0.0;
  for (const Surface& surface : field.surfaces) {
    const bool warm = surface.albedo[0] > surface.albedo[2];
    cream += warm;
    (warm ? light : dark) += surface.albedo.mean();
  }
  const std::size_t indigo = field.surfaces.size() - cream;
  const double share = static_cast<double>(cream) / static_cast<double>(field.surfaces.size());
  EXPECT_NEAR(share, 0.5, 0.1);
  EXPECT_GT(light / static_cast<double>(cream), 2.0 * dark / static_cast<double>(indigo));
}

TEST(Corrugated, HasThePrintOnTheSameRelief) {
  const HeightField plain = (*find_height_field_material("corrugated"))->make(kSize, 1);
  const HeightField print = (*find_height_field_material("corrugated-print"))->make(kSize, 1);
  EXPECT_EQ(plain.heights, print.heights);
  bool warm = false;
  bool cold = false;
  for (std::size_t i = 0; i < plain.surfaces.size(); ++i) {
    EXPECT_GT(plain.surfaces[i].albedo[0], plain.surfaces[i].albedo[2]);
    EXPECT_EQ(plain.surfaces[i].f0, print.surfaces[i].f0);
    (print.surfaces[i].albedo[0] > print.surfaces[i].albedo[2] ? warm : cold) = true;
  }
  EXPECT_TRUE(warm && cold);
}

}  // namespace
}  // namespace veneer::simulation
