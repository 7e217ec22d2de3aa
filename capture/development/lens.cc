// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "capture/development/internal_lens.h"

namespace veneer::capture {

std::optional<Eigen::Vector2d> project(const CameraLens& lens, const Eigen::Vector3d& in_camera) {
  if (!(in_camera.z() > 0)) return std::nullopt;
  const Eigen::Vector2d plane = in_camera.head<2>() / in_camera.z();
  const double r2 = plane.squaredNorm();
  if (!(1 + r2 * (3 * lens.k1 + 5 * r2 * lens.k2) > 0)) return std::nullopt;
  const double bent = 1 + r2 * (lens.k1 + r2 * lens.k2);
  return (bent * plane).cwiseProduct(lens.focal_px) + lens.principal_point;
}

std::optional<Eigen::Vector3d> ray_through(const CameraLens& lens, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d bent = (pixel - lens.principal_point).cwiseQuotient(lens.focal_px);
  const double wanted = bent.norm();
  if (!std::isfinite(wanted)) return std::nullopt;
  // Newton on r (1 + k1 r^2 + k2 r^4) = wanted.
  double r = wanted;
  for (int i = 0; i < 20; ++i) {
    const double r2 = r * r;
    const double slope = 1 + r2 * (3 * lens.k1 + 5 * r2 * lens.k2);
    if (!(slope > 0)) return std::nullopt;
    r -= (r * (1 + r2 * (lens.k1 + r2 * lens.k2)) - wanted) / slope;
  }
  const double miss = r * (1 + r * r * (lens.k1 + r * r * lens.k2)) - wanted;
  if (!(std::abs(miss) < 1e-9 * (1 + wanted))) return std::nullopt;
  const Eigen::Vector2d plane = wanted > 0 ? Eigen::Vector2d(bent * (r / wanted)) : bent;
  return Eigen::Vector3d(plane.x(), plane.y(), 1).normalized();
}

Status check_lens(const CameraLens& lens) {
  if (lens.focal_px.allFinite() && lens.focal_px.minCoeff() > 0 &&
      lens.principal_point.allFinite() && std::isfinite(lens.k1) && std::isfinite(lens.k2))
    return {};
  return fail(Errc::kInvalidOption,
              "the camera's lens has focal lengths {} and {} px, principal point {}, {}, k1 {}, k2 "
              "{}: give finite values and focal lengths above 0",
              lens.focal_px.x(),
              lens.focal_px.y(),
              lens.principal_point.x(),
              lens.principal_point.y(),
              lens.k1,
              lens.k2);
}

}  // namespace veneer::capture
