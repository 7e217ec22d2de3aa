// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/gog/gain_offset_gamma.h"

#include <algorithm>
#include <cmath>

#include "base/result.h"

namespace veneer::calibration {

GainOffsetGamma::GainOffsetGamma(double offset, double exponent)
    : offset_(offset), exponent_(exponent), at_zero_(0.0) {
  VENEER_CHECK(offset >= kLeastOffset && offset <= kLargestOffset);
  VENEER_CHECK(exponent >= kLeastExponent && exponent <= kLargestExponent);
  at_zero_ = power(0.0);
}

double GainOffsetGamma::power(double drive) const {
  const double base = (1.0 - offset_) * drive + offset_;
  return base < 0.0 ? 0.0 : std::pow(base, exponent_);  // NaN stays NaN
}

double GainOffsetGamma::operator()(double drive) const {
  const double inside = std::clamp(drive, 0.0, 1.0);
  return (power(inside) - at_zero_) / (1.0 - at_zero_) + slope_at(inside) * (drive - inside);
}

double GainOffsetGamma::slope_at(double drive) const {
  const double base = (1.0 - offset_) * std::clamp(drive, 0.0, 1.0) + offset_;
  if (base < 0.0) return 0.0;
  return exponent_ * (1.0 - offset_) * std::pow(base, exponent_ - 1.0) / (1.0 - at_zero_);
}

}  // namespace veneer::calibration
