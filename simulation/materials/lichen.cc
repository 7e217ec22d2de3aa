// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "simulation/materials/body_materials.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"

namespace veneer::simulation {

namespace {

// Lengths in tile widths.
constexpr int kPlants = 3;         // along each side of the tile; one in four places is bare
constexpr double kJitter = 0.10;   // of their places
constexpr double kStalk = 0.014;   // radius
constexpr double kBranch = 0.034;  // radius
constexpr double kReach = 0.085;   // of a branch
constexpr double kStorey = 0.010;  // how far plants differ in height
constexpr int kBranches = 3;

void add_plant(const Eigen::Vector3d& crown, double turn, BodyField& field) {
  const Eigen::Vector3d root(crown.x(), crown.y(), 0.0);
  field.bodies.push_back(capsule(root, crown, kStalk));
  for (int i = 0; i < kBranches; ++i) {
    const double angle = 2.0 * std::numbers::pi * (turn + double(i) / kBranches);
    const Eigen::Vector3d tip =
        crown + kReach * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
    field.bodies.push_back(capsule(crown, tip, kBranch));
  }
}

}  // namespace

// Plants of two storeys on thin stalks over rock, their branches free above it.
BodyField make_lichen(int size, std::uint64_t seed) {
  BodyField field;
  field.resolution = size * kCellsPerTexel;
  for (int row = 0; row < kPlants; ++row) {
    for (int column = 0; column < kPlants; ++column) {
      const auto random = [&](std::uint64_t i) { return lattice_random(column, row, seed + i); };
      if (random(0) < 0.25) continue;
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
