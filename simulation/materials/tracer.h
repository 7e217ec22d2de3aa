// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "simulation/materials/body_field.h"
#include "simulation/materials/geometry.h"
#include "simulation/materials/height_field.h"
#include "simulation/materials/light_array.h"
#include "simulation/materials/shadow_table.h"
#include "simulation/materials/synthesis_options.h"

namespace veneer {
class Pcg32;
}

namespace veneer::simulation {

/// Traces paths from the eye into a material and connects each of their vertices to every light.
///
/// The picture of a view is the rectified picture of the reference plane: the ray of a place in a
/// texel runs through that place of the plane (a height field's mean height), along the view, and
/// sees what it meets first on its way down from above everything. Masking and parallax are in the
/// samples.
///
/// Parts: *specular* is light that was reflected by interfaces only, once or several times;
/// *diffuse* is light that was in the body, and so depolarised, at least once on its way. A chain
/// of mirror-like reflections keeps the light's own colour and (up to a turn of the plane) its
/// polarisation, so crossed polarisers remove it with the single reflection; and the dichromatic
/// model, whose specular term has the colour of the interface, means the same division.
///
/// Immutable after construction and thread-safe.
class Tracer {
 public:
  /// @param field, options  valid; the field may have any resolution.
  Tracer(const HeightField& field, const SynthesisOptions& options, Progress& progress);
  /// Bodies have no table of shadows: every shadow is a ray of its own.
  Tracer(const BodyField& field, const SynthesisOptions& options);

  /// All samples of a texel: pi * radiance for unit irradiance facing the light.
  /// @param texel  row by row, in [0, size^2)
  /// @param out  [view][light][specular R, G, B, diffuse R, G, B]
  void trace(int texel, std::span<float> out) const;

 private:
  // Sums over paths, per channel and light (padded).
  using Film = std::array<std::vector<float>, 6>;
  // In [0, 1): which way a path goes on, and in which direction.
  using Numbers = std::array<double, 3>;
  struct Vertex;

  void trace_path(const Eigen::Vector3d& place,
                  const Eigen::Vector3d& view,
                  Numbers numbers,
                  Pcg32& random,
                  Film& film) const;
  void add_direct_light(const Vertex& vertex, bool in_body, Film& film) const;
  [[nodiscard]] bool scatter(Vertex& vertex,
                             bool& in_body,
                             Eigen::Vector3d& direction,
                             const Numbers& numbers) const;
  void light_shares(const Vertex& vertex, std::span<float> lit) const;

  Tracer(std::shared_ptr<const Geometry> geometry, const SynthesisOptions& options);

  SynthesisOptions options_;
  std::shared_ptr<const Geometry> geometry_;
  LightArray lights_;
  std::vector<Eigen::Vector3d> views_;  // grid frame
  std::optional<ShadowTable> shadows_;  // of a relief, unless exact
};

}  // namespace veneer::simulation
