// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "simulation/materials/layer_truth.h"
#include "simulation/materials/solids.h"
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
  EXPECT_THAT(
      none.error().what,
      testing::HasSubstr("cloth, corrugated, corrugated-print, hammered, leather, plaster"));
}

TEST(BodyMaterials, AreFoundByNameAndHaveNamesOfTheirOwn) {
  for (const auto& material : body_materials()) {
    EXPECT_EQ(find_body_material(material.name), &material);
    EXPECT_FALSE(find_height_field_material(material.name).has_value());
  }
  EXPECT_EQ(find_body_material("cloth"), nullptr);
}

TEST(BodyMaterials, AreValidAndTheSameTileAtEverySize) {
  for (const auto& material : body_materials()) {
    const BodyField one = material.make(1, 4);
    for (const int size : {1, 7, kSize}) {
      const BodyField field = material.make(size, 4);
      EXPECT_EQ(field.resolution, size * kCellsPerTexel);
      const Status status = field.check();
      EXPECT_TRUE(status.has_value()) << material.name << ": " << status.error().what;
      ASSERT_EQ(field.bodies.size(), one.bodies.size()) << material.name;
      for (std::size_t i = 0; i < one.bodies.size(); ++i) {
        EXPECT_EQ(field.bodies[i].first, one.bodies[i].first) << material.name << ' ' << i;
        EXPECT_EQ(field.bodies[i].second, one.bodies[i].second) << material.name << ' ' << i;
      }
    }
  }
}

// Seen from above, heights and colours step no more across the tile's edges than elsewhere.
TEST(BodyMaterials, RepeatWithoutASeam) {
  constexpr int kPlaces = 96;
  for (const auto& material : body_materials()) {
    const Solids solids(material.make(kPlaces / kCellsPerTexel, 1));
    ASSERT_EQ(solids.resolution(), kPlaces);
    std::vector<double> seen;
    for (int i = 0; i < kPlaces * kPlaces; ++i) {
      const auto hit = solids.first_hit({i % kPlaces + 0.5, i / kPlaces + 0.5, solids.top()},
                                        -Eigen::Vector3d::UnitZ());
      ASSERT_TRUE(hit.has_value());
      seen.push_back(hit->z / kPlaces + solids.surface(*hit).albedo.mean());
    }
    for (const int step : {1, kPlaces}) {
      std::vector<double> steps(kPlaces, 0.0);  // of each line to the next
      for (int line = 0; line < kPlaces; ++line) {
        for (int i = 0; i < kPlaces; ++i) {
          const int across = kPlaces / step * i;  // i rows down, or i columns on
          const auto at = [&](int l) {
            return seen[static_cast<std::size_t>((l % kPlaces) * step + across)];
          };
          steps[static_cast<std::size_t>(line)] += std::abs(at(line + 1) - at(line));
        }
      }
      const double at_seam = steps.back();
      steps.pop_back();
      EXPECT_LE(at_seam, 1.1 * *std::ranges::max_element(steps)) << material.name << ' ' << step;
    }
  }
}

TEST(BodyMaterials, DependOnTheSeed) {
  for (const auto& material : body_materials()) {
    const auto colour = [&](std::uint64_t seed) {
      return material.make(kSize, seed).surface_at({0.31, 0.67, 0.0}, BodyField::kGround).albedo;
    };
    EXPECT_EQ(colour(1), colour(1)) << material.name;
    EXPECT_NE(colour(1), colour(2)) << material.name;
    EXPECT_NE(material.make(kSize, 1).bodies.front().first,
              material.make(kSize, 2).bodies.front().first)
        << material.name;
  }
}

// What they are for: matter over air, which no height field holds.
TEST(BodyMaterials, HoverAtTheirHeights) {
  constexpr int kTexels = 64 * 64;
  for (const auto& material : body_materials()) {
    const BodyField field = material.make(kSize, 1);
    const Solids solids(field);
    const LayerTruth truth = layer_truth(field, 64, material.heights);
    for (std::size_t layer = 0; layer + 1 < material.heights.size(); ++layer) {
      int matter = 0;
      int over_air = 0;
      for (int i = 0; i < kTexels; ++i) {
        if (truth.occupancy[layer * kTexels + static_cast<std::size_t>(i)] < 0.5F) continue;
        ++matter;
        over_air += solids.distance({(i % 64 + 0.5) / 64, (i / 64 + 0.5) / 64, 0.01}) > 0.0;
      }
      EXPECT_GT(matter, 0.08 * kTexels) << material.name << ' ' << layer;
      EXPECT_LT(matter, 0.5 * kTexels) << material.name << ' ' << layer;
      EXPECT_GT(over_air, 0.8 * matter) << material.name << ' ' << layer;
    }
  }
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
