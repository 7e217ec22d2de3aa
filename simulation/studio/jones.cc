// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/jones.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace veneer::simulation::studio {
namespace {

// Below this sine of the angle between light and view their plane is lost in rounding; at such an
// incidence s and p are reflected alike.
constexpr double kNoPlane = 1e-9;

/// Perpendicular to the plane of incidence.
Eigen::Vector3d s_direction(const Eigen::Vector3d& light, const Eigen::Vector3d& view) {
  const Eigen::Vector3d normal = light.cross(view);
  if (normal.norm() > kNoPlane) return normal.normalized();
  Eigen::Index least = 0;
  light.cwiseAbs().minCoeff(&least);
  return across_ray(Eigen::Vector3d::Unit(least), light);
}

}  // namespace

double power(const Beam& beam) { return beam[0].squaredNorm() + beam[1].squaredNorm(); }

Eigen::Vector3d across_ray(const Eigen::Vector3d& axis, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d across = axis - axis.dot(ray) / ray.squaredNorm() * ray;
  return across / across.norm();
}

Beam polarised_beam(const Eigen::Vector3d& light, const Eigen::Vector3d& axis, double extinction) {
  const Eigen::Vector3d along = across_ray(axis, light);
  // 1 / extinction is 0 for a perfect polariser, where extinction / (extinction + 1) has no value.
  const double leak = 1 / extinction;
  return {std::sqrt(1 / (1 + leak)) * along, std::sqrt(leak / (1 + leak)) * light.cross(along)};
}

Beam reflected_by_dielectric(const Beam& beam,
                             const Eigen::Vector3d& light,
                             const Eigen::Vector3d& view,
                             double index) {
  const Eigen::Vector3d s = s_direction(light, view);
  // Both turn with their rays, so that for view = light they are one and r_s = r_p.
  const Eigen::Vector3d p_in = s.cross(light);
  const Eigen::Vector3d p_out = s.cross(view);
  const double cos_i = std::sqrt(std::max(0.0, 0.5 * (1 + light.dot(view))));
  const double cos_t = std::sqrt(1 - (1 - cos_i * cos_i) / (index * index));
  const double r_s = (cos_i - index * cos_t) / (cos_i + index * cos_t);
  const double r_p = (cos_t - index * cos_i) / (cos_t + index * cos_i);
  const double scale = 1 / std::sqrt(0.5 * (r_s * r_s + r_p * r_p));
  Beam out;
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = scale * (r_s * beam[i].dot(s) * s + r_p * beam[i].dot(p_in) * p_out);
  return out;
}

Beam reflected_by_mirror(const Beam& beam,
                         const Eigen::Vector3d& light,
                         const Eigen::Vector3d& view) {
  const Eigen::Vector3d normal = (light + view).normalized();
  Beam out;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = 2 * beam[i].dot(normal) * normal - beam[i];
  return out;
}

Analyser::Analyser(const Eigen::Vector3d& view,
                   const Eigen::Vector3d& axis,
                   double angle_rad,
                   double extinction)
    : leak_(1 / extinction) {
  const Eigen::Vector3d x = across_ray(axis, view);
  const Eigen::Vector3d y = view.cross(x);
  along_ = std::cos(angle_rad) * x + std::sin(angle_rad) * y;
  across_ = std::cos(angle_rad) * y - std::sin(angle_rad) * x;
}

double Analyser::passed(const Beam& beam) const {
  double sum = 0;
  for (const Eigen::Vector3d& field : beam) {
    const double along = field.dot(along_);
    const double across = field.dot(across_);
    sum += along * along + leak_ * across * across;
  }
  return sum;
}

double Analyser::passed_unpolarised() const { return 0.5 * (1 + leak_); }

}  // namespace veneer::simulation::studio
