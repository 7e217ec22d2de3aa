// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/step.h"

namespace veneer::calibration {
namespace {

/// Along each side of the picture, where a person has to point the instrument at each.
constexpr int kSpotsByHand = 3;

}  // namespace

Result<Answer> measure_light(StepContext& context) {
  WizardResults& results = context.results;
  if (!results.projector) {
    if (!context.options.known_geometry)
      return fail(
          Errc::kInvalidOption,
          "the projector's geometry is not known, and the slant of the board is divided out "
          "with it; do the step geometry, or give one with --geometry");
    results.projector = context.options.known_geometry;
  }
  RadiometryOptions options = context.options.radiometry;
  options.bits = context.devices.bits;
  if (!context.devices.aims_itself) {
    options.vignetting_columns = kSpotsByHand;
    options.vignetting_rows = kSpotsByHand;
  }
  VENEER_ASSIGN(
      results.measured,
      measure_profile(
          context.recorded, context.recorded, *results.projector, options, context.progress));
  for (const std::string& warning : results.measured->warnings)
    context.find({Finding::Severity::kWarning, warning, ""});
  const MeasuredProfile& measured = *results.measured;
  context.report.summary = fmt::format(
      "{} readings, {} patches fitted; {}; {} held-out patches: dE00 {:.2f} mean, {:.2f} at most",
      measured.readings,
      measured.fitted_patches,
      measured.choice,
      measured.held_out.patches,
      measured.held_out.mean,
      measured.held_out.max);
  return Answer::kDone;
}

}  // namespace veneer::calibration
