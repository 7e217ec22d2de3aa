// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulation/materials/internal_materials.h"
#include "simulation/materials/internal_noise.h"
#include "simulation/materials/phong_texture.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {

namespace {

constexpr int kWaves = 4;             // a tile, along x
constexpr double kAmplitude = 0.04;   // tile widths: flanks of 45 degrees at their steepest
constexpr double kPaperGrain = 4e-4;  // tile widths

// Fibres of the paper, about 1.
float tone_at(double x, double y, std::uint64_t seed) {
  const double fibres =
      0.10 * smooth_noise(x, y, 64, 12, seed + 10) + 0.06 * cloud_noise(x, y, 6, 3, seed + 20);
  return static_cast<float>(std::clamp(1.0 + fibres, 0.6, 1.3));
}

// A wave whose flanks shade, shadow and mirror in turns, under a varnish.
template <class AlbedoAt>
HeightField varnished_wave(int size, std::uint64_t seed, const AlbedoAt& albedo_at) {
  const auto height_at = [&](double x, double y) {
    return kAmplitude * std::cos(2.0 * std::numbers::pi * kWaves * x) +
           kPaperGrain * smooth_noise(x, y, 48, 24, seed);
  };
  const auto surface_at = [&](double x, double y) {
    return Surface{albedo_at(x, y), Eigen::Vector3f::Constant(0.05F), 0.22F};
  };
  return sampled_field(size * kCellsPerTexel, 32.0, height_at, surface_at);
}

}  // namespace

// The sheet of Obara et al. 2006, of kraft paper.
HeightField make_corrugated(int size, std::uint64_t seed) {
  return varnished_wave(size, seed, [&](double x, double y) -> Eigen::Vector3f {
    return Eigen::Vector3f(0.58F, 0.36F, 0.19F) * tone_at(x, y, seed);
  });
}

// The same with a print of all hues on it, so that colour and relief vary apart.
HeightField make_corrugated_print(int size, std::uint64_t seed) {
  return varnished_wave(size, seed, [&](double x, double y) -> Eigen::Vector3f {
    const Eigen::Vector3f ink = phong_texture(x, y, seed + 30).diffuse.cast<float>();
    return (ink * tone_at(x, y, seed)).cwiseMin(1.0F);
  });
}

}  // namespace veneer::simulation
