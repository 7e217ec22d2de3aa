// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace veneer {

/// Colours in IPT: I lightness, P red to green, T yellow to blue; lines of equal hue are straight
/// and run from the axis P = T = 0. White is (1, 0, 0).
using Ipt = Eigen::Vector3d;

/// Cone responses of XYZ, 1 each for D65 with Y = 1.
/// Source: Ebner and Fairchild 1998, "Development and Testing of a Color Space (IPT) with Improved
/// Hue Uniformity", the matrix of Hunt, Pointer and Estevez scaled to D65.
[[nodiscard]] const Eigen::Matrix3d& cones_from_xyz();
/// The second matrix of IPT, from cones to the power kIptExponent. Its rows sum to 1, 0, 0.
[[nodiscard]] const Eigen::Matrix3d& ipt_from_powers();
inline constexpr double kIptExponent = 0.43;

/// @param cones  relative to the white's, so that the adapted white is (1, 1, 1); below 0 the power
/// is odd-symmetric, as its authors define it.
[[nodiscard]] Ipt ipt_from_cones(const Eigen::Vector3d& cones);
[[nodiscard]] Eigen::Vector3d cones_from_ipt(const Ipt& ipt);

}  // namespace veneer
