// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/steps/internal_patches.h"

namespace veneer::calibration {

Result<Answer> look_at_room(StepContext& context) {
  constexpr int kReadings = 10;  // tell a standard deviation to a quarter of itself
  VENEER_ASSIGN(const std::vector<Xyz> ambient,
                read_patch(context, grey(0), kReadings, /*lit=*/false));
  VENEER_ASSIGN(const std::vector<Xyz> white,
                read_patch(context, grey(full_code(context.devices)), kReadings));
  context.results.ambient = repeatability(ambient);
  context.results.white = repeatability(white);
  for (Finding& finding : diagnose_room(context.results.ambient, context.results.white))
    context.find(std::move(finding));
  context.report.summary = fmt::format(
      "the room sends {:.3g} cd/m^2, {:.2f} % of white; a reading of white scatters by {:.2f} %",
      context.results.ambient.mean.y(),
      100 * context.results.ambient.mean.y() / context.results.white.mean.y(),
      100 * context.results.white.relative);
  return Answer::kDone;
}

}  // namespace veneer::calibration
