// SPDX-License-Identifier: Apache-2.0
#include "base/ipt.h"

#include <Eigen/LU>

#include <cmath>

namespace veneer {
namespace {

Eigen::Vector3d signed_power(const Eigen::Vector3d& values, double exponent) {
  return values.unaryExpr(
      [exponent](double x) { return std::copysign(std::pow(std::abs(x), exponent), x); });
}

}  // namespace

const Eigen::Matrix3d& cones_from_xyz() {
  static const Eigen::Matrix3d kMatrix = (Eigen::Matrix3d() << 0.4002,
                                          0.7075,
                                          -0.0807,  //
                                          -0.2280,
                                          1.1500,
                                          0.0612,  //
                                          0.0,
                                          0.0,
                                          0.9184)
                                             .finished();
  return kMatrix;
}

const Eigen::Matrix3d& ipt_from_powers() {
  static const Eigen::Matrix3d kMatrix = (Eigen::Matrix3d() << 0.4000,
                                          0.4000,
                                          0.2000,  //
                                          4.4550,
                                          -4.8510,
                                          0.3960,  //
                                          0.8056,
                                          0.3572,
                                          -1.1628)
                                             .finished();
  return kMatrix;
}

Ipt ipt_from_cones(const Eigen::Vector3d& cones) {
  return ipt_from_powers() * signed_power(cones, kIptExponent);
}

Eigen::Vector3d cones_from_ipt(const Ipt& ipt) {
  static const Eigen::Matrix3d kPowersFromIpt = ipt_from_powers().inverse();
  return signed_power(kPowersFromIpt * ipt, 1.0 / kIptExponent);
}

}  // namespace veneer
