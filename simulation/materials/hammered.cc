// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

constexpr int kDents = 7;  // a tile, along each side
constexpr double kDepth =
    0.045;  // tile widths, times the squared distance in dents: slopes up to 0.4

}  // namespace

// Copper beaten with a round hammer: shallow bowls that meet in soft ridges.
HeightField make_hammered(int size, std::uint64_t seed) {
  const auto height_at = [&](double x, double y) {
    const CellDistances dents = cell_distances(x, y, kDents, 1.0, 0.05, seed);
    return kDepth * (0.8 + 0.4 * smooth_noise(x, y, 3, 3, seed + 30)) * dents.smooth_square +
           8e-4 * cloud_noise(x, y, 24, 2, seed + 40);
  };
  const auto surface_at = [&](double x, double y) {
    const auto worn = static_cast<float>(cloud_noise(x, y, 8, 3, seed + 50));
    Surface surface;
    surface.albedo = Eigen::Vector3f(0.40F, 0.06F, 0.02F);
    surface.f0 = Eigen::Vector3f(0.80F, 0.50F, 0.37F) * (0.93F + 0.03F * worn);
    surface.alpha = 0.28F + 0.02F * worn;
    return surface;
  };
  return sampled_field(size * kCellsPerTexel, 40.0, height_at, surface_at);
}

}  // namespace veneer::simulation
