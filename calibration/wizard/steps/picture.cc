// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <set>

#include "calibration/wizard/steps/internal_patches.h"

namespace veneer::calibration {
namespace {

/// Of full drive: dense where a limited range and clipping show.
constexpr std::array kRampDrives{0.008, 0.016, 0.031, 0.047, 0.063, 0.078, 0.094,
                                 0.125, 0.19,  0.25,  0.38,  0.5,   0.63,  0.75,
                                 0.85,  0.9,   0.925, 0.95,  0.975, 1.0};
/// Readings of black and white from which their scatter is told.
constexpr int kRepeats = 3;

}  // namespace

Result<Answer> check_picture(StepContext& context) {
  VENEER_ASSIGN(
      const Answer aimed,
      context.please(Task::kAimAtBoard,
                     0,
                     "Put the white board square to the projector's axis at the reference distance "
                     "and point the instrument at its middle, where the picture's middle is."));
  if (aimed != Answer::kDone) return aimed;
  const std::uint16_t full = full_code(context.devices);
  VENEER_ASSIGN(const std::vector<Xyz> whites, read_patch(context, grey(full), kRepeats));
  VENEER_ASSIGN(const std::vector<Xyz> blacks, read_patch(context, grey(0), kRepeats));
  const Repeatability white = repeatability(whites);
  const Repeatability black = repeatability(blacks);
  for (Finding& finding : diagnose_picture(black.mean, white.mean, white.relative))
    context.find(std::move(finding));
  // Where nothing changes, a ramp would say nothing more.
  if (!context.report.findings.empty() &&
      context.report.findings.front().severity == Finding::Severity::kFailure)
    return Answer::kDone;

  GreyRamp ramp;
  ramp.noise = std::max(white.relative, 1e-3);  // three readings may agree by chance
  std::set<std::uint16_t> seen{0};
  ramp.drive.push_back(0);
  ramp.luminance.push_back(0);
  for (const double drive : kRampDrives) {
    const auto code = static_cast<std::uint16_t>(std::lround(drive * full));
    if (!seen.insert(code).second) continue;
    VENEER_ASSIGN(const std::vector<Xyz> reading, read_patch(context, grey(code), 1));
    ramp.drive.push_back(static_cast<double>(code) / full);
    ramp.luminance.push_back(reading.front().y() - black.mean.y());
  }
  for (Finding& finding : diagnose_ramp(ramp)) context.find(std::move(finding));
  context.report.summary =
      fmt::format("white {:.1f} cd/m^2, black {:.3g} cd/m^2, exponent about {:.2f}",
                  white.mean.y(),
                  black.mean.y(),
                  effective_gamma(ramp));
  context.results.ramp = std::move(ramp);
  return Answer::kDone;
}

}  // namespace veneer::calibration
