// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "simulation/materials/body_materials.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"

namespace veneer::simulation {

namespace {

// Lengths in tile widths.
constexpr int kPlants = 3;  // along each side of the tile; some places are bare
constexpr double kBare = 0.15;
constexpr double kJitter = 0.10;  // of their places
constexpr double kStalk = 0.014;  // radius
constexpr double kLeaf = 0.070;   // radius
constexpr double kHalfThickness = 0.010;
constexpr double kOff = 0.065;     // of a leaf's middle from the stalk
constexpr double kDroop = 0.30;    // tangent of its outward slope
constexpr double kStorey = 0.010;  // how far plants differ in height
constexpr int kLeaves = 3;

void add_plant(const Eigen::Vector3d& crown, double turn, BodyField& field) {
  const Eigen::Vector3d root(crown.x(), crown.y(), 0.0);
  field.bodies.push_back(capsule(root, crown, kStalk));
  for (int i = 0; i < kLeaves; ++i) {
    const double angle = 2.0 * std::numbers::pi * (turn + double(i) / kLeaves);
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0.0);
    const Eigen::Vector3d axis = kLeaf * (kDroop * out + Eigen::Vector3d::UnitZ()).normalized();
    field.bodies.push_back(disc(crown + kOff * out, axis, kHalfThickness));
  }
}

}  // namespace

// Plants of two storeys on thin stalks over rock, their drooping leaves free above it.
BodyField make_lichen(int size, std::uint64_t seed) {
  BodyField field;
  field.resolution = size * kCellsPerTexel;
  for (int row = 0; row < kPlants; ++row) {
    for (int column = 0; column < kPlants; ++column) {
      const auto random = [&](std::uint64_t i) { return lattice_random(column, row, seed + i); };
      if (random(0) < kBare) continue;
      const double storey = kLichenHeights[random(1) < 0.5 ? 0 : 1];
      add_plant({(column + 0.5) / kPlants + kJitter * (random(2) - 0.5),
                 (row + 0.5) / kPlants + kJitter * (random(3) - 0.5),
                 storey + kStorey * (random(4) - 0.5)},
                random(5),
                field);
    }
  }
  field.surface_at = [seed](const Eigen::Vector3d& place, int body) {
    const bool rock = body == BodyField::kGround;
    // What is high is drier and paler; the pattern leans, so that sides have one too.
    const double x = place.x() + 0.4 * place.z();
    const double y = place.y() + 0.7 * place.z();
    const double pattern = cloud_noise(x, y, 8, 2, seed + (rock ? 40 : 50));
    Surface surface;
    surface.f0 = Eigen::Vector3f::Constant(rock ? 0.04F : 0.02F);
    surface.alpha = rock ? 0.35F : 0.7F;
    const Eigen::Vector3f colour =
        rock ? Eigen::Vector3f(0.30F, 0.27F, 0.26F) : Eigen::Vector3f(0.42F, 0.50F, 0.22F);
    const double tone = rock ? 1.0 + 0.4 * pattern : 0.8 + 2.0 * place.z() + 0.3 * pattern;
    surface.albedo = colour * static_cast<float>(tone);
    return surface;
  };
  return field;
}

}  // namespace veneer::simulation
