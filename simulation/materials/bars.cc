// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/body_materials.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"

namespace veneer::simulation {

namespace {

// Lengths in tile widths.
constexpr int kBars = 2;  // a tile, in each direction
constexpr double kHalfWidth = 0.09;
constexpr double kHalfThickness = 0.009;
constexpr double kEdge = 0.006;   // radius
constexpr double kUneven = 0.06;  // of their distances

// Paint, worn: without a texture nobody could say how far away a thing is.
Eigen::Vector3f worn(const Eigen::Vector3f& paint, double x, double y, std::uint64_t seed) {
  return paint * static_cast<float>(1.0 + 0.3 * cloud_noise(x, y, 8, 2, seed));
}

}  // namespace

// Painted bars along x over others along y, both free above a pale ground.
BodyField make_bars(int size, std::uint64_t seed) {
  BodyField field;
  field.resolution = size * kCellsPerTexel;
  for (const bool along_x : {true, false}) {
    for (int i = 0; i < kBars; ++i) {
      const double off = kUneven * (lattice_random(i, along_x ? 0 : 1, seed) - 0.5);
      field.bodies.push_back(endless_bar(along_x,
                                         (i + 0.5) / kBars + off,
                                         kBarHeights[along_x ? 0 : 1],
                                         kHalfWidth,
                                         kHalfThickness,
                                         kEdge));
    }
  }
  field.surface_at = [seed](const Eigen::Vector3d& place, int body) {
    Surface surface;
    surface.f0 = Eigen::Vector3f::Constant(0.04F);
    surface.alpha = 0.4F;
    // Each of them has a pattern of its own; on the ground it is finest.
    const auto own = seed + 100U * static_cast<std::uint64_t>(body + 2);
    const Eigen::Vector3f paint = body == BodyField::kGround ? Eigen::Vector3f(0.55F, 0.53F, 0.46F)
                                  : body < kBars             ? Eigen::Vector3f(0.52F, 0.13F, 0.08F)
                                                             : Eigen::Vector3f(0.10F, 0.22F, 0.48F);
    surface.albedo = worn(paint, place.x(), place.y(), own);
    return surface;
  };
  return field;
}

}  // namespace veneer::simulation
