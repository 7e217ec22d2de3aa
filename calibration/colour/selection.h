// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "calibration/colour/additivity.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Colour differences of a model from readings: CIEDE2000, black in both (docs/CONVENTIONS.md).
struct ColourError {
  int patches = 0;
  double mean = 0;
  double p95 = 0;
  double max = 0;
};

/// @param readings  black still in them.   @param white  what full drive sends, black included.
[[nodiscard]] ColourError colour_error(const ColourModel& model,
                                       std::span<const PatchReading> readings,
                                       const Xyz& black,
                                       const Xyz& white);

/// How one family did.
struct ColourCandidate {
  std::string_view name;
  bool fitted = false;
  std::string refusal;  ///< why it was not fitted; empty if it was
  int parameters = 0;
  int patches = 0;       ///< different drives that it was fitted on
  ColourError held_out;  ///< on patches that no fit saw
};

struct SelectedColour {
  std::unique_ptr<ColourModel> model;
  std::vector<ColourCandidate> candidates;  ///< every family, in the registry's order
  std::string reason;                       ///< a sentence for people: which, and why
};

/// A mean dE00 so little over the best one is no reason for a model of more parameters: a tenth of
/// the 0.5 that is asked of the best, which nobody sees.
inline constexpr double kWorthMoreParameters = 0.05;

/// Fits every family that may be used and takes the one with the least mean error on `held_out`;
/// among those within kWorthMoreParameters of it, the one with the fewest parameters.
///
/// Where the channels do not add up, only families that model interaction are fitted; where that
/// is not decisive, all are. A family that cannot be fitted is listed with the reason. The white is
/// the mean reading at full drive; where there is none, the sum of the channels at full drive.
/// @param fitted  as ColourModelFamily::fit wants them; all families get all of them.
/// @param held_out  at least one; those whose drive is in `fitted` are left out.
/// Errors: kBadFormat (no family could be fitted, nothing is held out, a reading that is not
/// finite).
[[nodiscard]] Result<SelectedColour> select_colour_model(std::span<const PatchReading> fitted,
                                                         std::span<const PatchReading> held_out,
                                                         const Xyz& black,
                                                         const Additivity& additivity);

}  // namespace veneer::calibration
