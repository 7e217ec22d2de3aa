// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <string_view>
#include <vector>

#include "base/progress.h"
#include "btf/direction.h"
#include "simulation/materials/height_field.h"
#include "simulation/materials/internal_materials.h"
#include "simulation/materials/synthesize.h"
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
    trace(Tracer(field, options, silent));
  }
  TracedSet(const BodyField& field, const SynthesisOptions& options) : options_(options) {
    trace(Tracer(field, options));
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
  void trace(const Tracer& tracer) {
    stride_ = options_.views.size() * options_.lights.size() * 6;
    samples_.resize(static_cast<std::size_t>(options_.size * options_.size) * stride_);
    for (int texel = 0; texel < options_.size * options_.size; ++texel) {
      tracer.trace(texel,
                   std::span(samples_).subspan(static_cast<std::size_t>(texel) * stride_, stride_));
    }
  }

  SynthesisOptions options_;
  std::size_t stride_ = 0;
  std::vector<float> samples_;
};

/// Traces every material there is. @param use  (std::string_view name, const TracedSet&)
template <class Use>
void for_each_material(int size,
                       std::uint64_t seed,
                       const SynthesisOptions& options,
                       const Use& use) {
  for (const auto& material : height_field_materials())
    use(material.name, TracedSet(material.make(size, seed), options));
  for (const auto& material : body_materials())
    use(material.name, TracedSet(material.make(size, seed), options));
}

}  // namespace veneer::simulation
