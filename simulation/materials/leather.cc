// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

constexpr int kGrains = 13;             // a tile, along each side
constexpr double kGrainHeight = 0.011;  // tile widths

// What lies at a place of the hide.
struct Grain {
  double height;  // 0 in a crease to 1 in the middle of a grain
  double crease;  // 1 in a crease, 0 beside it
};

Grain grain_at(double x, double y, std::uint64_t seed) {
  const double wander = 0.02;  // of the creases, tile widths
  const double wx = x + wander * cloud_noise(x, y, 7, 2, seed + 60);
  const double wy = y + wander * cloud_noise(x, y, 7, 2, seed + 70);
  const CellDistances cells = cell_distances(wx, wy, kGrains, 0.95, 0.05, seed);
  const double gap = cells.second - cells.nearest;
  const double dome = 1.0 - std::min(1.0, cells.nearest * cells.nearest);
  return {smooth_step(-0.1, 0.35, gap) * (0.45 + 0.55 * dome) * (0.7 + 0.3 * cells.random),
          1.0 - smooth_step(0.02, 0.22, gap)};
}

}  // namespace

// Pressed cow hide: rounded grains between dark creases, pores, a clear coat over all.
HeightField make_leather(int size, std::uint64_t seed) {
  const auto height_at = [&](double x, double y) {
    return kGrainHeight * grain_at(x, y, seed).height +
           0.0018 * cloud_noise(x, y, 16, 3, seed + 80) +
           0.004 * cloud_noise(x, y, 3, 2, seed + 85);
  };
  const auto surface_at = [&](double x, double y) {
    const double crease = grain_at(x, y, seed).crease;
    const double patchy = 1.0 + 0.15 * cloud_noise(x, y, 5, 4, seed + 90);
    const auto tone = static_cast<float>((1.0 - 0.6 * crease) * patchy);
    Surface surface;
    surface.albedo = Eigen::Vector3f(0.21F, 0.095F, 0.045F) * tone;
    surface.f0 = Eigen::Vector3f::Constant(0.045F);
    surface.alpha = static_cast<float>(0.26 + 0.14 * crease);  // creases are less polished
    return surface;
  };
  return sampled_field(size * kCellsPerTexel, 20.0, height_at, surface_at);
}

}  // namespace veneer::simulation
