// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>

#include "base/progress.h"
#include "base/result.h"
#include "btf/direction.h"
#include "simulation/materials/synthesis_options.h"

namespace veneer::simulation {

/// A flat point that reflects as a formula says, f_r = diffuse / pi + strength (n + 2) / (2 pi)
/// max(0, cos a)^n, a the angle between the view and the mirrored light. Reciprocal, and never more
/// than what arrives where diffuse + strength <= 1.
///
/// Source: Phong 1975, "Illumination for Computer Generated Pictures"; its energy as in Lafortune,
/// Willems 1994, "Using the Modified Phong Reflectance Model for Physically Based Rendering".
struct PhongPoint {
  Eigen::Vector3d diffuse = Eigen::Vector3d::Constant(0.5);  ///< RGB, each in [0, 1]
  double strength = 0.0;   ///< of the lobe, which has the light's own colour; in [0, 1]
  double exponent = 10.0;  ///< n >= 0

  /// Samples (btf/sample_set.h) of both parts, 0 for a light or a view at or below the horizon.
  [[nodiscard]] Eigen::Vector3d diffuse_sample(const btf::Direction& view,
                                               const btf::Direction& light) const;
  [[nodiscard]] double specular_sample(const btf::Direction& view,
                                       const btf::Direction& light) const;
};

/// A texture of all hues, each point with a strength and an exponent of its own.
/// @param x, y  in tile widths, y downwards; it repeats without a seam.
[[nodiscard]] PhongPoint phong_texture(double x, double y, std::uint64_t seed);

/// Writes phong_texture() as a polarised sample set; `samples`, `bounces` and `exact_shadows` mean
/// nothing here. What Obara et al. 2006 simulate in section 4 is one view along the normal and 81
/// lights. Nothing is left behind by a failure. Errors: kInvalidOption, kIo.
[[nodiscard]] Status synthesize_phong(const std::filesystem::path& out,
                                      const SynthesisOptions& options,
                                      Progress& progress);

}  // namespace veneer::simulation
