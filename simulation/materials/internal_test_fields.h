// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "base/progress.h"
#include "btf/direction.h"
#include "simulation/materials/height_field.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/tracer.h"

// What the tests of this folder share.

namespace veneer::simulation {

inline btf::Direction toward(double theta_deg, double phi_deg) {
  const double degree = std::numbers::pi / 180.0;
  return btf::direction_from_angles({theta_deg * degree, phi_deg * degree});
}

inline Surface white_lambert() { return {Eigen::Vector3f::Ones(), Eigen::Vector3f::Zero(), 0.3F}; }

/// A zigzag along x: `grooves` valleys a tile, flanks of `slope`.
inline HeightField zigzag(int resolution, int grooves, double slope, const Surface& surface) {
  return sampled_field(
      resolution,
      10.0,
      [&](double x, double) {
        const double phase = x * grooves - std::floor(x * grooves);
        return slope / grooves * std::abs(phase - 0.5);
      },
      [&](double, double) { return surface; });
}

/// All samples of a small set, [texel][view][light][6].
class TracedSet {
 public:
  TracedSet(const HeightField& field, const SynthesisOptions& options) : options_(options) {
    SilentProgress silent;
    const Tracer tracer(field, options, silent);
    stride_ = options.views.size() * options.lights.size() * 6;
    samples_.resize(static_cast<std::size_t>(options.size * options.size) * stride_);
    for (int texel = 0; texel < options.size * options.size; ++texel) {
      tracer.trace(texel,
                   std::span(samples_).subspan(static_cast<std::size_t>(texel) * stride_, stride_));
    }
  }
  [[nodiscard]] const std::vector<float>& samples() const { return samples_; }
  [[nodiscard]] double at(int texel,
                          std::size_t view,
                          std::size_t light,
                          std::size_t channel) const {
    return samples_[static_cast<std::size_t>(texel) * stride_ +
                    (view * options_.lights.size() + light) * 6 + channel];
  }
  /// Specular + diffuse of one colour (0 to 2), averaged over the tile.
  [[nodiscard]] double mean(std::size_t view, std::size_t light, std::size_t colour) const {
    const int texels = options_.size * options_.size;
    double sum = 0.0;
    for (int texel = 0; texel < texels; ++texel) {
      sum += at(texel, view, light, colour) + at(texel, view, light, 3 + colour);
    }
    return sum / texels;
  }

 private:
  SynthesisOptions options_;
  std::size_t stride_ = 0;
  std::vector<float> samples_;
};

}  // namespace veneer::simulation
