// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/result.h"

namespace veneer::capture {

// Light that travels along a unit vector d, described with respect to a basis (x, y) perpendicular
// to d with x cross y = d: for who looks into the light (as a camera does), y is 90 degrees
// counter-clockwise from x. Every function says which basis its light has on either side; nothing
// is implied.

/// S0, S1, S2, S3.
using Stokes = Eigen::Vector4d;
using Mueller = Eigen::Matrix4d;

/// Light of unit S0, fully polarised along an angle from x.
[[nodiscard]] Stokes polarised_light(double angle_rad);
/// The same light with respect to a basis that is turned by `angle_rad` counter-clockwise.
[[nodiscard]] Mueller turned_basis(double angle_rad);
/// A polariser whose axis is at `angle_rad` from x: it passes 1 along it, 1 / extinction across.
/// @param extinction  at least 1 (1 does nothing); infinity is a perfect one.
/// Source: Collett 2005, "Field Guide to Polarization", the diattenuator; no retardance.
[[nodiscard]] Mueller polariser(double angle_rad, double extinction);
/// What a perfect depolariser leaves: S0.
[[nodiscard]] Mueller depolariser();

/// Reflectances of a dielectric, amplitude ratios of the field: negative is a turn by half a wave.
struct FresnelAmplitudes {
  double s = 0;
  /// In the convention in which p's axis turns with the ray (x cross y as above on either side):
  /// equal to s in size and opposite in sign at normal incidence.
  double p = 0;
  [[nodiscard]] double s_reflectance() const { return s * s; }
  [[nodiscard]] double p_reflectance() const { return p * p; }
  [[nodiscard]] double mean_reflectance() const { return 0.5 * (s * s + p * p); }
};
/// From air into a medium. An index of 1 reflects nothing.
/// @param cos_incidence  in [0, 1], cut to it.   @param index  of refraction, real, at least 1.
/// Source: Born and Wolf 1999, "Principles of Optics", 7th edition, section 1.5.2.
[[nodiscard]] FresnelAmplitudes fresnel_amplitudes(double cos_incidence, double index);

/// What a dielectric facet does that sends light from `light` to `view` (unit, both away from the
/// surface, local frame): from the light's basis, whose x is the vector nearest to `light_axis`
/// perpendicular to the light, to the camera's, whose x is the one nearest to `view_axis`
/// perpendicular to the view. In units of reflectance. Where light and view are one, the plane of
/// incidence is any. Light and view swapped give the transpose with the signs of S2 changed on
/// either side, since who looks into the light then stands on the other side.
/// Errors: kInvalidOption (an axis along its ray, view opposite to light, a direction without
/// length, an index below 1).
[[nodiscard]] Result<Mueller> facet_reflection(const Eigen::Vector3d& light,
                                               const Eigen::Vector3d& view,
                                               const Eigen::Vector3d& light_axis,
                                               const Eigen::Vector3d& view_axis,
                                               double index);

}  // namespace veneer::capture
