// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <span>
#include <vector>

#include "base/result.h"
#include "capture/recording.h"

namespace veneer::capture {

/// From counts to light: a monotone table for each channel over counts / full_scale in [0, 1],
/// linear between its entries, 0 at 0 and 1 at 1.
class ResponseCurve {
 public:
  /// Counts are light.
  ResponseCurve();
  /// counts = light^(1 / gamma). Errors: kInvalidOption (gamma not in [0.1, 10]).
  [[nodiscard]] static Result<ResponseCurve> gamma(double gamma);
  /// @param light  at equally spaced counts, in any unit: it is shifted and scaled to 0 at 0 and 1
  /// at 1. Errors: kInvalidOption (fewer than 2, not increasing, not finite).
  [[nodiscard]] static Result<ResponseCurve> tabulated(
      const std::array<std::vector<double>, 3>& light);

  /// In parts of what saturates; cut to [0, 1].
  [[nodiscard]] double light(int channel, double counts_fraction) const;
  /// d light / d (counts fraction), for noise.
  [[nodiscard]] double slope(int channel, double counts_fraction) const;
  /// The inverse of light(): the counts that this light makes; cut to [0, 1].
  [[nodiscard]] double counts_fraction(int channel, double light) const;
  [[nodiscard]] bool linear() const;

 private:
  std::array<std::vector<double>, 3> light_;
};

enum class ResponseMethod { kDebevec, kRobertson };
struct RecoveredResponse {
  ResponseCurve curve;
  /// Root mean square disagreement of overlapping exposures after linearisation, in parts of full
  /// scale, and before it: whether the recovery is to be believed.
  double residual = 0;
  double residual_if_linear = 0;
};
/// From a bracket of an unmoving scene: at least three exposures whose ratios are known; dark
/// pictures among them (Shot::dark) are taken off. OpenCV's 8-bit curve is the start of a fit to
/// the counts of full depth, and is kept where that fits better. Errors: kInvalidOption (too few
/// exposures, sizes that differ), kBadFormat (too little of the range is covered).
[[nodiscard]] Result<RecoveredResponse> recover_response(std::span<const Picture> bracket,
                                                         ResponseMethod method);

}  // namespace veneer::capture
