// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <span>
#include <string>
#include <vector>

#include "base/colour.h"

namespace veneer::calibration {

/// Something that a person should know, and what to do about it.
struct Finding {
  enum class Severity {
    kNote,     ///< nothing to be done
    kWarning,  ///< figures will be worse than they could be
    kFailure,  ///< no use going on
  };
  Severity severity = Severity::kNote;
  std::string what;    ///< "codes 0 to 15 are all black"
  std::string remedy;  ///< "set the output's range to full"; may be empty
};

/// Whether the picture reaches the spot that the instrument looks at.
/// @param black, white  readings of the darkest and the brightest patch.
/// @param noise  of a reading, in parts of it.
[[nodiscard]] std::vector<Finding> diagnose_picture(const Xyz& black,
                                                    const Xyz& white,
                                                    double noise);

/// A grey ramp: luminance above black of codes as parts of full drive.
struct GreyRamp {
  std::vector<double> drive;      ///< rising, 0 to 1
  std::vector<double> luminance;  ///< cd/m^2, above black; one each
  double noise = 0.003;           ///< of a reading, in parts of it
};
/// What is wrong with the signal between code and lamp: a cut-off range, a curve that was bent
/// beforehand, one that falls.
[[nodiscard]] std::vector<Finding> diagnose_ramp(const GreyRamp& ramp);

/// The exponent g of t = d^g that is nearest to the ramp in the logarithm, over its middle;
/// NaN where fewer than three levels lie between 2 and 98 % of full output.
[[nodiscard]] double effective_gamma(const GreyRamp& ramp);

/// How still the lamp stands: white at several times.
struct WarmUp {
  std::vector<double> seconds;    ///< since the first reading
  std::vector<double> luminance;  ///< cd/m^2
};
/// The change of the straight line through the readings of the last `window_s` seconds, in parts of
/// their mean, a minute; NaN for fewer than three readings or a window of no length.
[[nodiscard]] double drift_per_minute(const WarmUp& readings, double window_s);
/// The standard error of that, from what the readings scatter about the line; infinite for fewer
/// than four.
[[nodiscard]] double drift_error_per_minute(const WarmUp& readings, double window_s);

/// How much readings of one and the same thing scatter.
struct Repeatability {
  Xyz mean = Xyz::Zero();
  Xyz deviation = Xyz::Zero();  ///< standard deviation of one reading, cd/m^2
  /// The mean of `deviation` over `mean` where `mean` is positive; 0 where nothing is.
  double relative = 0;
};
[[nodiscard]] Repeatability repeatability(std::span<const Xyz> readings);

/// Of the room: flicker of its light, too much of it beside the projector's.
[[nodiscard]] std::vector<Finding> diagnose_room(const Repeatability& ambient,
                                                 const Repeatability& white);

}  // namespace veneer::calibration
