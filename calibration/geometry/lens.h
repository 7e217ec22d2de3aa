// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>

namespace veneer::geometry {

/// Pinhole with radial and tangential distortion: of a camera, or of a projector, which is a camera
/// whose light goes the other way. Pixels, first centre (0.5, 0.5); +z forward, x right, y down.
///
/// With x = X/Z, y = Y/Z and r^2 = x^2 + y^2,
///   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
///   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y,
/// and the pixel is (fx x' + cx, fy y' + cy). Its coefficients are OpenCV's; cx and cy are larger
/// by one half than OpenCV's, whose first centre is (0, 0). Source: Brown 1966, "Decentering
/// Distortion of Lenses", in the form of OpenCV's manual.
struct Lens {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;

  /// fx, fy, cx, cy, k1, k2, p1, p2, k3.
  [[nodiscard]] std::array<double, 9> coefficients() const {
    return {fx, fy, cx, cy, k1, k2, p1, p2, k3};
  }
  /// The pixel of a point in the lens's frame; NaN for a point not in front (Z <= 0).
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const;
};

/// What of a lens is fitted; the rest is 0.
enum class LensModel {
  kPinhole,  ///< fx, fy, cx, cy
  kRadial,   ///< and k1, k2
  kFull,     ///< and p1, p2, k3
};

}  // namespace veneer::geometry
