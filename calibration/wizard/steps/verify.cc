// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/step.h"

namespace veneer::calibration {

Result<Answer> verify(StepContext& context) {
  WizardResults& results = context.results;
  results.verification.reset();
  if (!results.measured)
    return fail(Errc::kInvalidOption, "there is no profile to be proved; do the step light");
  // Not the seed of the patches by which "veneer verify" asks later.
  constexpr std::uint64_t kSeed = 1;
  const ProjectorProfile& profile = results.measured->profile;
  VENEER_ASSIGN(
      results.verification,
      verify_profile(
          context.recorded,
          context.recorded,
          profile,
          verification_patches(
              profile, context.options.verification_patches, kSeed, context.devices.aims_itself),
          {context.options.verification_repeats},
          context.progress));
  const Verdict verdict = judge(*results.verification);
  if (!verdict.good) context.find({Finding::Severity::kWarning, verdict.sentence, ""});
  context.report.summary = verdict.sentence;
  return Answer::kDone;
}

}  // namespace veneer::calibration
