// SPDX-License-Identifier: Apache-2.0
#include "daemon/projector_care.h"

#include <fmt/ranges.h>

#include <string>
#include <utility>
#include <vector>

#include "calibration/profile_store.h"

namespace veneer::daemon {

using service::FaultKind;

namespace {

/// What changed and what is wrong now, each in words of its own: only the first can be set back.
std::string alarm_of(const projector::ControlReport& report) {
  std::string text;
  if (!report.changes.empty())
    text = fmt::format("since the profile was measured: {}; set it back, or calibrate again",
                       fmt::join(report.changes, "; "));
  if (!report.warnings.empty())
    text += fmt::format("{}the projector spoils the colours now: {}",
                        text.empty() ? "" : ". And ",
                        fmt::join(report.warnings, "; "));
  return text;
}

}  // namespace

ProjectorCare::ProjectorCare(projector::ControlWatch::Open open,
                             projector::ControlRecord kept,
                             std::filesystem::path profile,
                             const projector::ControlWatchOptions& options,
                             Faults& faults,
                             Clock& clock)
    : profile_(std::move(profile)),
      faults_(faults),
      clock_(clock),
      watch_(std::move(open), std::move(kept), options) {}

void ProjectorCare::look(const std::filesystem::path& profile, std::uint64_t changes) {
  const bool another = profile != profile_ || changes != changes_;
  profile_ = profile;
  changes_ = changes;
  if (another) {
    // One that cannot be read any more was reported by who drew with it.
    if (const auto loaded = calibration::ProfileStore(profile_).load_newest_good())
      watch_.keep(loaded->profile.record);
  }
  const projector::ControlReport report = watch_.report();
  if (!report.asked) return;
  const Time now = clock_.now();
  if (!report.reachable) {
    faults_.begin(FaultKind::kProjector, now, report.text);
    return;  // what it said last still holds, for all that is known
  }
  faults_.end(FaultKind::kProjector, now);
  if (report.changes.empty() && report.warnings.empty())
    faults_.end(FaultKind::kProjectorState, now);
  else
    faults_.begin(FaultKind::kProjectorState, now, alarm_of(report));
}

}  // namespace veneer::daemon
