// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace veneer::calibration {

/// ((1 - b) d + b)^g above its value at 0, over the same at 1; where (1 - b) d + b < 0 it is 0
/// before that. 0 at drive 0, 1 at drive 1, not falling.
/// Source: the gain-offset-gamma form of a display's channel, Berns 1996, "Methods for
/// Characterizing CRT Displays"; gain and offset add up to 1 because full drive is measured.
class GainOffsetGamma {
 public:
  static constexpr double kLeastOffset = -0.3;
  static constexpr double kLargestOffset = 0.3;
  static constexpr double kLeastExponent = 1.0;  ///< below, the slope at 0 may be infinite
  static constexpr double kLargestExponent = 5.0;

  /// @param offset  b, kLeastOffset to kLargestOffset (checked).
  /// @param exponent  g, kLeastExponent to kLargestExponent (checked).
  GainOffsetGamma(double offset, double exponent);
  /// Beyond [0, 1] straight on.
  [[nodiscard]] double operator()(double drive) const;
  [[nodiscard]] double slope_at(double drive) const;

 private:
  [[nodiscard]] double power(double drive) const;
  double offset_;
  double exponent_;
  double at_zero_;
};

}  // namespace veneer::calibration
