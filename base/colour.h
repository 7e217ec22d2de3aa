// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace veneer {

/// CIE 1931 XYZ. Y is cd/m^2 where the name says luminance, else relative.
using Xyz = Eigen::Vector3d;

/// CIE L*a*b*.
struct Lab {
  double l{};
  double a{};
  double b{};
};

/// XYZ of linear sRGB (IEC 61966-2-1 primaries, D65 white with Y = 1).
[[nodiscard]] const Eigen::Matrix3d& xyz_from_srgb();
[[nodiscard]] const Eigen::Matrix3d& srgb_from_xyz();

/// sRGB transfer function, IEC 61966-2-1; odd-symmetric below 0, unbounded above 1.
[[nodiscard]] double srgb_encode(double linear);
[[nodiscard]] double srgb_decode(double encoded);

/// CIE 1976 L*a*b*. L* may exceed 100. @param white  Y > 0 and X, Z > 0.
[[nodiscard]] Lab lab_from_xyz(const Xyz& xyz, const Xyz& white);

/// CIEDE2000 colour difference with unit weights (CIE 142-2001), as LittleCMS computes it.
[[nodiscard]] double delta_e_2000(const Lab& a, const Lab& b);

}  // namespace veneer
