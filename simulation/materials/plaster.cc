// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

// Tile widths.
constexpr double kTrowelled = 0.02;  // waves that the trowel left
constexpr double kGrain = 0.002;     // of sand

}  // namespace

// Dry lime plaster. Its pores scatter what enters them; hardly any light is mirrored where it
// arrives, so that nearly all of what it sends is diffuse.
HeightField make_plaster(int size, std::uint64_t seed) {
  const auto height_at = [seed](double x, double y) {
    return kTrowelled * cloud_noise(x, y, 4, 3, seed) +
           kGrain * cloud_noise(x, y, 32, 2, seed + 10);
  };
  const auto surface_at = [seed](double x, double y) {
    const auto tone = static_cast<float>(1.0 + 0.10 * cloud_noise(x, y, 3, 4, seed + 20) +
                                         0.06 * cloud_noise(x, y, 32, 2, seed + 10));
    Surface surface;
    surface.albedo = Eigen::Vector3f(0.70F, 0.62F, 0.50F) * tone;
    surface.f0 = Eigen::Vector3f::Constant(0.001F);
    surface.alpha = 0.8F;
    return surface;
  };
  return sampled_field(size * kCellsPerTexel, 60.0, height_at, surface_at);
}

}  // namespace veneer::simulation
