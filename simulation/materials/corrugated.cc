// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

constexpr int kWaves = 4;             // a tile, along x
constexpr double kAmplitude = 0.04;   // tile widths: flanks of 45 degrees at their steepest
constexpr double kPaperGrain = 4e-4;  // tile widths

}  // namespace

// The sheet of Obara et al. 2006: a wave whose flanks shade, shadow and mirror in turns. Kraft
// paper under a varnish.
HeightField make_corrugated(int size, std::uint64_t seed) {
  const auto height_at = [&](double x, double y) {
    return kAmplitude * std::cos(2.0 * std::numbers::pi * kWaves * x) +
           kPaperGrain * smooth_noise(x, y, 48, 24, seed);
  };
  const auto surface_at = [&](double x, double y) {
    const double fibres =
        0.10 * smooth_noise(x, y, 64, 12, seed + 10) + 0.06 * cloud_noise(x, y, 6, 3, seed + 20);
    const auto tone = static_cast<float>(std::clamp(1.0 + fibres, 0.6, 1.3));
    return Surface{
        Eigen::Vector3f(0.58F, 0.36F, 0.19F) * tone, Eigen::Vector3f::Constant(0.05F), 0.22F};
  };
  return sampled_field(size * kCellsPerTexel, 32.0, height_at, surface_at);
}

}  // namespace veneer::simulation
