// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>

namespace veneer::simulation::studio {

// Polarised light as fields. Polarisers and the reflections here shift no phase but by half a wave,
// so a field is real: a vector of the sample's local frame, perpendicular to its ray, which is a
// Jones vector in no other basis than space itself. Its square is its power. Directions are unit
// vectors and point away from the sample, to the light or to the camera.

/// Light as two fields that have nothing to do with each other: their powers add up.
using Beam = std::array<Eigen::Vector3d, 2>;

[[nodiscard]] double power(const Beam& beam);

/// The unit vector that is nearest to `axis` among those perpendicular to `ray`. NaN where both are
/// one.
[[nodiscard]] Eigen::Vector3d across_ray(const Eigen::Vector3d& axis, const Eigen::Vector3d& ray);

/// Light of unit power behind a polariser along across_ray(axis, light).
/// @param extinction  at least 1 (unpolarised light); infinity leaves one field.
[[nodiscard]] Beam polarised_beam(const Eigen::Vector3d& light,
                                  const Eigen::Vector3d& axis,
                                  double extinction);

/// Reflected from `light` to `view` by a dielectric facet between both, whose index of refraction
/// is above 1; in parts of what it reflects of unpolarised light, so that a beam of unpolarised
/// light keeps its power. For view = light the plane of incidence is any.
/// Source: Born and Wolf 1999, section 1.5.2.
[[nodiscard]] Beam reflected_by_dielectric(const Beam& beam,
                                           const Eigen::Vector3d& light,
                                           const Eigen::Vector3d& view,
                                           double index);
/// The same by a perfect mirror, which turns the field as it turns the ray.
[[nodiscard]] Beam reflected_by_mirror(const Beam& beam,
                                       const Eigen::Vector3d& light,
                                       const Eigen::Vector3d& view);

/// A polariser before the camera.
class Analyser {
 public:
  /// @param angle_rad  of its axis from across_ray(axis, view), counter-clockwise for who looks at
  ///                   the sample from the camera.
  /// @param extinction  at least 1; infinity is a perfect one.
  Analyser(const Eigen::Vector3d& view,
           const Eigen::Vector3d& axis,
           double angle_rad,
           double extinction);
  [[nodiscard]] double passed(const Beam& beam) const;
  /// Of unpolarised light of unit power.
  [[nodiscard]] double passed_unpolarised() const;

 private:
  Eigen::Vector3d along_;
  Eigen::Vector3d across_;
  double leak_;  // power across over power along
};

}  // namespace veneer::simulation::studio
