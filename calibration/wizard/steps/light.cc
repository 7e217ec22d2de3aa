// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "calibration/wizard/step.h"

namespace veneer::calibration {
namespace {

/// Along each side of the picture, where a person has to point the instrument at each.
constexpr int kSpotsByHand = 3;
/// Scatter of a reading that may go into a fit; an instrument with more is read more often, up to
/// kMostRepeats times, which takes a quarter of an hour.
constexpr double kScatter = 0.004;
constexpr int kMostRepeats = 16;

/// Readings whose mean scatters by no more than kScatter, if so many are bearable.
int repeats_for(double relative_scatter) {
  const double wanted = std::pow(relative_scatter / kScatter, 2);
  return wanted >= kMostRepeats ? kMostRepeats : std::max(1, static_cast<int>(std::lround(wanted)));
}

}  // namespace

Result<Answer> measure_light(StepContext& context) {
  WizardResults& results = context.results;
  results.measured.reset();
  results.verification.reset();
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
  options.patch_repeats = repeats_for(results.white.relative);
  options.repeats = std::max(options.repeats, options.patch_repeats);
  if (options.patch_repeats > 1)
    context.find({Finding::Severity::kNote,
                  fmt::format("a reading scatters by {:.1f} %, so each patch is read {} times",
                              100 * results.white.relative,
                              options.patch_repeats),
                  ""});
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
