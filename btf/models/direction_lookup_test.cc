// SPDX-License-Identifier: Apache-2.0
#include "btf/models/direction_lookup.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

using testing::random_direction;

std::map<int, double> by_index(const DirectionWeights& weights) {
  std::map<int, double> sums;
  for (std::size_t i = 0; i < 3; ++i) sums[weights.index[i]] += weights.weight[i];
  return sums;
}

double largest_difference(const DirectionWeights& a, const DirectionWeights& b) {
  std::map<int, double> difference = by_index(a);
  for (const auto& [index, weight] : by_index(b)) difference[index] -= weight;
  double largest = std::abs(a.scale - b.scale);
  for (const auto& [index, weight] : difference) largest = std::max(largest, std::abs(weight));
  return largest;
}

struct Agreement {
  double exact = 0.0;  ///< part of the directions that agree to float precision
  double worst = 0.0;
};

Agreement compare(const DirectionSet& directions, DirectionRole role) {
  const SphericalInterpolator reference(directions, role);
  const DirectionLookup lookup(directions, role);
  Pcg32 random(1);
  Agreement agreement;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    const Direction d = random_direction(random, 1e-3);
    const double difference = largest_difference(reference.weights(d), lookup.weights(d));
    if (difference < 1e-5) agreement.exact += 1.0 / kSamples;
    agreement.worst = std::max(agreement.worst, difference);
  }
  return agreement;
}

TEST(DirectionLookup, AgreesWithTheReferenceButWhereAnEdgeCrossesACell) {
  for (const DirectionRole role : {DirectionRole::kView, DirectionRole::kLight}) {
    const Agreement agreement = compare(bonn_directions(), role);
    EXPECT_GT(agreement.exact, 0.9);
    EXPECT_LT(agreement.worst, 0.12);  // a cell is an eighth of a triangle at most
  }
}

DirectionSet scattered(int count) {
  Pcg32 random(3);
  DirectionSet directions;
  for (int i = 0; i < count; ++i) directions.push_back(random_direction(random, 0.05));
  return directions;
}

// The lights of a real RTI dome, placed by hand; none where the data are absent.
DirectionSet lion_lights() {
  const char* data = std::getenv("VENEER_DATA");
  std::ifstream file(std::filesystem::path(data == nullptr ? "" : data) / "rti_loewenkopf" /
                     "dirs.lp");
  int count = 0;
  file >> count;
  std::string name;
  Direction light;
  DirectionSet lights;
  while (file >> name >> light.x() >> light.y() >> light.z()) lights.push_back(light.normalized());
  return lights;
}

// Many views in a small patch, 40 degrees from the normal: all cells around it lie outside.
DirectionSet patch() {
  DirectionSet views;
  for (int i = 0; i < 400; ++i)
    views.push_back(direction_from_angles({0.7 + 0.004 * (i / 20), 0.3 + 0.006 * (i % 20)}));
  return views;
}

std::map<std::string, DirectionSet> irregular_sets() {
  std::map<std::string, DirectionSet> sets{
      {"bonn", bonn_directions()}, {"scattered", scattered(200)}, {"patch", patch()}};
  if (const DirectionSet lights = lion_lights(); !lights.empty()) sets["lion"] = lights;
  return sets;
}

TEST(DirectionLookup, WeightsArePartsOfOne) {
  for (const auto& [name, directions] : irregular_sets()) {
    const DirectionLookup lookup(directions, DirectionRole::kView);
    Pcg32 random(2);
    for (int i = 0; i < 20000; ++i) {
      const DirectionWeights weights = lookup.weights(random_direction(random));
      EXPECT_NEAR(weights.weight[0] + weights.weight[1] + weights.weight[2], 1.0, 1e-12) << name;
      for (const double weight : weights.weight) EXPECT_GE(weight, 0.0) << name;
      EXPECT_EQ(weights.scale, 1.0);
    }
  }
}

// Unlike single weights, which turn quickly in thin triangles, where they point is steady.
TEST(DirectionLookup, PointsWhereTheReferenceDoes) {
  const std::map<std::string, double> most{
      {"bonn", 0.01}, {"lion", 0.05}, {"patch", 0.09}, {"scattered", 0.25}};
  constexpr double kMostMean = 4e-4;  // a twenty-fifth of a cell
  constexpr int kSamples = 50000;
  for (const auto& [name, directions] : irregular_sets()) {
    const DirectionLookup lookup(directions, DirectionRole::kView);
    const SphericalInterpolator reference(directions, DirectionRole::kView);
    const auto point = [&set = directions](const DirectionWeights& weights) {
      Direction sum = Direction::Zero();
      for (std::size_t i = 0; i < 3; ++i)
        sum += weights.weight[i] * set[static_cast<std::size_t>(weights.index[i])];
      return Direction(sum.normalized());
    };
    Pcg32 random(2);
    double worst = 0.0;
    double mean = 0.0;
    for (int i = 0; i < kSamples; ++i) {
      const Direction d = random_direction(random, 1e-3);
      const double off = (point(lookup.weights(d)) - point(reference.weights(d))).norm();
      worst = std::max(worst, off);
      mean += off / kSamples;
    }
    EXPECT_LT(worst, most.at(name)) << name;
    EXPECT_LT(mean, kMostMean) << name;
  }
}

TEST(DirectionLookup, OneDirectionNeedsOneRegionAndASmallPatchNotOneForEachCell) {
  const auto rows = [](const DirectionSet& directions) {
    std::vector<ModelTexture> textures;
    DirectionLookup(directions, DirectionRole::kView).add_textures("View", textures);
    return textures[1].height;
  };
  EXPECT_EQ(rows({Direction::UnitZ()}), 1);
  EXPECT_EQ(rows({Direction(0.6, 0.0, 0.8)}), 1);
  EXPECT_LT(rows(patch()), 100);  // of 1024 that would hold a region for each cell
}

TEST(DirectionLookup, GivesAMeasuredDirectionItself) {
  const DirectionSet directions = bonn_directions();
  const DirectionLookup lookup(directions, DirectionRole::kLight);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    auto sums = by_index(lookup.weights(directions[i]));
    EXPECT_NEAR(sums[static_cast<int>(i)], 1.0, 1e-4) << "direction " << i;
  }
}

TEST(DirectionLookup, LightsFadeWithTheCosineBeyondTheData) {
  const DirectionLookup lookup(bonn_directions(), DirectionRole::kLight);
  const double border = std::cos(75.0 * std::numbers::pi / 180.0);
  for (int i = 0; i < 100; ++i) {
    const double z = border * (0.01 + 0.0098 * i);
    const double radius = std::sqrt(1.0 - z * z);
    const Direction light(radius * std::cos(0.37 * i), radius * std::sin(0.37 * i), z);
    EXPECT_NEAR(lookup.weights(light).scale, z / border, 1e-5);
  }
}

// Exact where the border is a ring; else cosines are mixed along a border that goes up and down.
TEST(DirectionLookup, LightsFadeNearlyAsInTheReferenceOnScatteredSets) {
  struct Bound {
    double worst, mean;
  };
  const std::map<std::string, Bound> most{{"bonn", {1e-6, 1e-7}},
                                          {"lion", {0.35, 1e-4}},
                                          {"patch", {0.03, 3e-4}},
                                          {"scattered", {0.15, 5e-5}}};
  constexpr int kSamples = 50000;
  for (const auto& [name, directions] : irregular_sets()) {
    const DirectionLookup lookup(directions, DirectionRole::kLight);
    const SphericalInterpolator reference(directions, DirectionRole::kLight);
    Pcg32 random(4);
    double worst = 0.0;
    double mean = 0.0;
    for (int i = 0; i < kSamples; ++i) {
      const Direction d = random_direction(random, 1e-3);
      const double off = std::abs(lookup.weights(d).scale - reference.weights(d).scale);
      worst = std::max(worst, off);
      mean += off / kSamples;
    }
    EXPECT_LT(worst, most.at(name).worst) << name;
    EXPECT_LT(mean, most.at(name).mean) << name;
  }
}

TEST(DirectionLookup, AgreesForSetsWithoutTrianglesOrNotAroundTheNormal) {
  const DirectionSet bonn = bonn_directions();
  const std::map<std::string, DirectionSet> sets{
      {"one", {bonn[40]}},
      {"the normal", {Direction::UnitZ()}},
      {"two", {bonn[3], bonn[60]}},
      {"an arc", {bonn[57], bonn[1], bonn[0]}},
      {"one side", {bonn[57], bonn[58], bonn[59], bonn[37], bonn[38]}},
      {"a few", {bonn[0], bonn[60], bonn[66], bonn[72], bonn[78]}},
  };
  for (const auto& [name, directions] : sets) {
    for (const DirectionRole role : {DirectionRole::kView, DirectionRole::kLight}) {
      const DirectionLookup lookup(directions, role);
      const SphericalInterpolator reference(directions, role);
      Pcg32 random(3);
      double mean = 0.0;
      constexpr int kSamples = 2000;
      for (int i = 0; i < kSamples; ++i) {
        const Direction d = random_direction(random, 1e-3);
        const DirectionWeights weights = lookup.weights(d);
        EXPECT_TRUE(std::isfinite(weights.weight[0] + weights.weight[1] + weights.weight[2]))
            << name;
        mean += largest_difference(reference.weights(d), weights) / kSamples;
      }
      EXPECT_LT(mean, 0.02)
          << name;  // cells of a 256th of the square, cosines linear along an edge
    }
  }
}

}  // namespace
}  // namespace veneer::btf
