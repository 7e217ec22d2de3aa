// SPDX-License-Identifier: Apache-2.0
#include "base/colour.h"

#include <Eigen/LU>
#include <lcms2.h>

#include <cmath>

namespace veneer {

const Eigen::Matrix3d& xyz_from_srgb() {
  // From the chromaticities of IEC 61966-2-1 (0.64, 0.33), (0.30, 0.60), (0.15, 0.06), white
  // (0.3127, 0.3290), solved for Y = 1 at R = G = B = 1.
  static const Eigen::Matrix3d kMatrix = [] {
    const auto xyz = [](double x, double y) { return Eigen::Vector3d(x / y, 1, (1 - x - y) / y); };
    Eigen::Matrix3d primaries;
    primaries << xyz(0.64, 0.33), xyz(0.30, 0.60), xyz(0.15, 0.06);
    const Eigen::Vector3d luminances = primaries.inverse() * xyz(0.3127, 0.3290);
    return Eigen::Matrix3d(primaries * luminances.asDiagonal());
  }();
  return kMatrix;
}

const Eigen::Matrix3d& srgb_from_xyz() {
  static const Eigen::Matrix3d kMatrix = xyz_from_srgb().inverse();
  return kMatrix;
}

double srgb_encode(double linear) {
  const double magnitude = std::abs(linear);
  const double encoded =
      magnitude <= 0.0031308 ? 12.92 * magnitude : 1.055 * std::pow(magnitude, 1 / 2.4) - 0.055;
  return std::copysign(encoded, linear);
}

double srgb_decode(double encoded) {
  const double magnitude = std::abs(encoded);
  const double linear =
      magnitude <= 0.04045 ? magnitude / 12.92 : std::pow((magnitude + 0.055) / 1.055, 2.4);
  return std::copysign(linear, encoded);
}

Lab lab_from_xyz(const Xyz& xyz, const Xyz& white) {
  const cmsCIEXYZ white_point{white.x(), white.y(), white.z()};
  const cmsCIEXYZ colour{xyz.x(), xyz.y(), xyz.z()};
  cmsCIELab lab;
  cmsXYZ2Lab(&white_point, &lab, &colour);
  return {lab.L, lab.a, lab.b};
}

double delta_e_2000(const Lab& a, const Lab& b) {
  const cmsCIELab first{a.l, a.a, a.b};
  const cmsCIELab second{b.l, b.a, b.b};
  return cmsCIE2000DeltaE(&first, &second, 1, 1, 1);
}

}  // namespace veneer
