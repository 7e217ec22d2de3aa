// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <chrono>
#include <ctime>

#include "base/files.h"
#include "calibration/profile_files.h"
#include "calibration/profile_store.h"
#include "calibration/wizard/report.h"
#include "calibration/wizard/steps/internal_projector.h"

namespace veneer::calibration {
namespace {

std::string utc_now() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return {text.data(), length};
}

/// What a later reader wants to know of how the profile came about.
std::map<std::string, std::string> record_of(const StepContext& context, const std::string& made) {
  const WizardResults& results = context.results;
  std::map<std::string, std::string> record{{"made", made},
                                            {"projector", context.devices.projector},
                                            {"instrument", context.devices.instrument}};
  if (results.geometry)
    record["geometry"] = fmt::format("{} board poses, held out {:.3f} px rms",
                                     results.views.size(),
                                     results.geometry->held_out_projector_rms_px);
  record.insert(results.projector_record.begin(), results.projector_record.end());
  record["colour"] = results.measured->choice;
  if (results.verification) {
    const ProfileVerification& v = *results.verification;
    record["verified"] = fmt::format("dE00 {:.3f} mean, {:.3f} at 95 %, {:.3f} at most, {} patches",
                                     v.de00_mean,
                                     v.de00_p95,
                                     v.de00_max,
                                     v.patches.size());
  }
  const auto warn = [&record](const StepReport& step) {
    for (const Finding& finding : step.findings) {
      if (finding.severity == Finding::Severity::kNote) continue;
      std::string& text = record["warnings"];
      text += (text.empty() ? "" : "\n") + finding.what;
    }
  };
  for (const StepReport& step : context.reports) warn(step);
  warn(context.report);  // what publishing itself found
  return record;
}

}  // namespace

Result<Answer> publish(StepContext& context) {
  WizardResults& results = context.results;
  if (!results.measured)
    return fail(Errc::kInvalidOption, "there is nothing to write; do the step light");
  VENEER_TRY(look_at_projector_again(context));
  const std::string made = utc_now();
  results.measured->profile.record = record_of(context, made);
  const ProjectorProfile& profile = results.measured->profile;
  nlohmann::ordered_json report = report_of(results, context.reports, context.devices);
  report["made"] = made;
  const ProfileStore store(context.options.profile);
  const auto extra = [&](const std::filesystem::path& folder) -> Status {
    VENEER_TRY(write_profile_files(
        profile, results.measured->patches, context.devices.instrument, folder));
    VENEER_TRY(write_text(folder / "report.json", report.dump(1) + "\n"));
    return write_text(folder / "report.html", report_page(report));
  };
  VENEER_TRY(store.publish(profile, extra));
  context.report.summary = fmt::format("wrote {}; look at {}",
                                       context.options.profile.string(),
                                       (context.options.profile / "report.html").string());
  return Answer::kDone;
}

}  // namespace veneer::calibration
