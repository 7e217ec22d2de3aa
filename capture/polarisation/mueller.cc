// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/mueller.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace veneer::capture {
namespace {

/// Sine of the angle to its ray below which an axis says nothing about the plane across the ray.
constexpr double kLeastAcross = 1e-6;
/// Chord between light and view below which rounding decides about the plane of incidence; light
/// that comes back on itself is reflected alike for any.
constexpr double kLeastPlane = 1e-9;

/// x and y across a ray, for who looks into the light.
struct Basis {
  Eigen::Vector3d x, y;
};

/// @param to_source  unit, towards where the light comes from.
Result<Basis> basis_across(const Eigen::Vector3d& to_source,
                           const Eigen::Vector3d& axis,
                           std::string_view whose) {
  const Eigen::Vector3d x = axis - axis.dot(to_source) * to_source;
  if (!(x.norm() > kLeastAcross * axis.norm()))
    return fail(Errc::kInvalidOption,
                "reflecting polarised light: the axis of the {} ({}, {}, {}) lies along its ray; "
                "turn the axis, or leave that direction out",
                whose,
                axis.x(),
                axis.y(),
                axis.z());
  return Basis{x.normalized(), x.cross(to_source).normalized()};
}

/// Of a vector across the ray, counter-clockwise from x.
double angle_in(const Basis& basis, const Eigen::Vector3d& vector) {
  return std::atan2(vector.dot(basis.y), vector.dot(basis.x));
}

}  // namespace

Stokes polarised_light(double angle_rad) {
  return {1, std::cos(2 * angle_rad), std::sin(2 * angle_rad), 0};
}

Mueller turned_basis(double angle_rad) {
  const double c = std::cos(2 * angle_rad);
  const double s = std::sin(2 * angle_rad);
  Mueller turn = Mueller::Identity();
  turn.block<2, 2>(1, 1) << c, s, -s, c;
  return turn;
}

Mueller polariser(double angle_rad, double extinction) {
  VENEER_CHECK(extinction >= 1);
  const double leak = 1 / extinction;
  Mueller along_x = Mueller::Zero();
  along_x.topLeftCorner<2, 2>() << 1 + leak, 1 - leak, 1 - leak, 1 + leak;
  along_x(2, 2) = along_x(3, 3) = 2 * std::sqrt(leak);
  return 0.5 * turned_basis(-angle_rad) * along_x * turned_basis(angle_rad);
}

Mueller depolariser() {
  Mueller result = Mueller::Zero();
  result(0, 0) = 1;
  return result;
}

FresnelAmplitudes fresnel_amplitudes(double cos_incidence, double index) {
  VENEER_CHECK(index >= 1);
  const double cos_i = std::clamp(cos_incidence, 0.0, 1.0);
  // By Snell's law; as a sum of what is not negative, it keeps its digits up to grazing.
  const double index_cos_t = std::sqrt((index - 1) * (index + 1) + cos_i * cos_i);
  if (index_cos_t == 0) return {};  // index 1 at grazing: nothing is there to reflect
  const double across = index * index * cos_i;
  return {(cos_i - index_cos_t) / (cos_i + index_cos_t),
          (across - index_cos_t) / (across + index_cos_t)};
}

Result<Mueller> facet_reflection(const Eigen::Vector3d& light,
                                 const Eigen::Vector3d& view,
                                 const Eigen::Vector3d& light_axis,
                                 const Eigen::Vector3d& view_axis,
                                 double index) {
  if (!(index >= 1) || !std::isfinite(index))
    return fail(Errc::kInvalidOption,
                "reflecting polarised light: an index of refraction of {} is not at least 1; "
                "plastics and varnish have about 1.5",
                index);
  if (!light.allFinite() || !view.allFinite() || light.isZero(0) || view.isZero(0))
    return fail(Errc::kInvalidOption,
                "reflecting polarised light: the direction of light or view has no length");
  const Eigen::Vector3d to_light = light.normalized();
  const Eigen::Vector3d to_view = view.normalized();
  if ((to_light + to_view).norm() < kLeastAcross)
    return fail(Errc::kInvalidOption,
                "reflecting polarised light: the view is opposite to the light, so that no facet "
                "sends one to the other; leave that pair out");
  VENEER_ASSIGN(const Basis light_basis, basis_across(to_light, light_axis, "light"));
  // Reflected light comes from where the view looks, against the view.
  VENEER_ASSIGN(const Basis view_basis, basis_across(-to_view, view_axis, "view"));
  const Eigen::Vector3d across = to_light.cross(to_view);
  const Eigen::Vector3d s = across.norm() < kLeastPlane ? light_basis.x : across.normalized();

  const double cos_incidence = 0.5 * (to_light + to_view).norm();
  const FresnelAmplitudes fresnel = fresnel_amplitudes(cos_incidence, index);
  const double difference = 0.5 * (fresnel.s_reflectance() - fresnel.p_reflectance());
  Mueller in_plane = Mueller::Zero();
  in_plane(0, 0) = in_plane(1, 1) = fresnel.mean_reflectance();
  in_plane(0, 1) = in_plane(1, 0) = difference;
  in_plane(2, 2) = in_plane(3, 3) = fresnel.s * fresnel.p;
  return Mueller(turned_basis(-angle_in(view_basis, s)) * in_plane *
                 turned_basis(angle_in(light_basis, s)));
}

}  // namespace veneer::capture
