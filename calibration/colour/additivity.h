// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// A mixture against the sum of its channels, black taken from all.
struct MixtureError {
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();
  /// (sum - mixture) / mixture: of X, Y and Z in parts of the brightest white read, the difference
  /// that is largest in size, over the mixture's largest component.
  double error = 0;
  double uncertainty = 0;  ///< of `error`, one standard deviation, by the readings' own scatter
};

/// Whether light of channels adds up.
struct Additivity {
  std::vector<MixtureError> mixtures;
  /// Of the mixture that is off most.
  double worst_error = 0;
  double uncertainty = 0;
  /// Whether |worst_error| is at most kAdditivityLimit: models without interaction may be used.
  bool additive = true;
  /// Whether the readings are quiet enough for the verdict to be trusted, see kAdditivityMargin.
  bool decisive = true;
  std::string reason;  ///< a sentence for people
};

/// Midway between what must always be found, 3 %, and what must never be, 1 %.
inline constexpr double kAdditivityLimit = 0.02;
/// From the limit to either of them; a verdict wants it to be four standard deviations or more.
inline constexpr double kAdditivityMargin = 0.01;

/// Compares every mixture in `readings` with the sum of its channels read at the same drives.
///
/// Readings of the same drive are averaged; how far they lie apart, pooled over all drives as a
/// part of each reading, is the noise. With the 4 repeats of additivity_patches() and 0.3 % of
/// noise in each of X, Y and Z, 3 % is always found and 1 % never is (additivity_test.cc).
/// Errors: kBadFormat (a reading that is not finite; no mixture whose channels were all read; a
/// mixture that is not brighter than black).
[[nodiscard]] Result<Additivity> test_additivity(std::span<const PatchReading> readings,
                                                 const Xyz& black);

}  // namespace veneer::calibration
