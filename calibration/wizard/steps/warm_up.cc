// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "calibration/wizard/steps/internal_patches.h"

namespace veneer::calibration {
namespace {

/// A session that goes on under another lamp does not fit together.
constexpr double kLargestJump = 0.01;
/// Beyond this it is no lamp that drifts: the lens is covered, the instrument looks elsewhere.
constexpr double kAbsurdJump = 0.2;
constexpr int kMostTimeouts = 5;
/// Readings whose mean is remembered as the settled white.
constexpr std::size_t kSettledReadings = 8;

/// White as it had settled when the session was here last; 0 where it never was.
double earlier_white(const Journal& journal) {
  const nlohmann::json* found = journal.find("warm-up", "settled white");
  return found != nullptr && found->is_number() ? found->get<double>() : 0.0;
}

}  // namespace

// Not recalled when a session is resumed: the lamp may have been off in between.
Result<Answer> warm_up(StepContext& context) {
  const WizardOptions& options = context.options;
  Devices& devices = context.devices;
  WarmUp& readings = context.results.warm_up;
  readings = {};
  const Eigen::Vector2d centre = raster_centre(devices);
  int timeouts = 0;
  const Time begin = devices.clock->now();
  bool settled = false;
  context.progress.start("warming up", static_cast<std::int64_t>(options.most_warm_up_s));
  double reported = 0;
  double window = options.warm_up_window_s;
  while (true) {
    const Time next = devices.clock->now() + from_seconds(options.warm_up_interval_s);
    // Each time anew: what lies over the picture meanwhile (a dialog, a dimmed window) goes.
    VENEER_TRY(devices.display->show(grey(full_code(devices))));
    auto reading = devices.colorimeter->read(Target::kWhiteReference, centre);
    timeouts = reading ? 0 : timeouts + 1;
    if (!reading && (reading.error().code != Errc::kTimeout || timeouts >= kMostTimeouts))
      return tl::unexpected(reading.error());
    const double elapsed = to_seconds(devices.clock->now() - begin);
    if (reading && reading->allFinite() && reading->y() > 0) {
      readings.seconds.push_back(elapsed);
      readings.luminance.push_back(reading->y());
    }
    context.progress.advance(static_cast<std::int64_t>(elapsed - reported));
    reported = elapsed;
    // A noisy instrument needs longer to tell a drift from its own scatter.
    window = std::max(options.warm_up_window_s, 0.5 * elapsed);
    const double drift = std::abs(drift_per_minute(readings, window));
    const double error = drift_error_per_minute(readings, window);
    if (elapsed >= options.warm_up_window_s && drift + 2 * error <= options.settled_per_minute) {
      settled = true;
      break;
    }
    if (elapsed >= options.most_warm_up_s) break;
    devices.clock->sleep_until(next);
  }
  context.progress.finish();
  if (readings.luminance.empty())
    return fail(Errc::kTimeout,
                "the instrument gave no reading of white; is it still pointed at the "
                "board?");
  const double minutes = readings.seconds.back() / 60;
  const double drift = drift_per_minute(readings, window);
  if (!settled)
    context.find({Finding::Severity::kWarning,
                  fmt::format("after {:.0f} minutes white still changes by {:+.2f} % a minute",
                              minutes,
                              100 * drift),
                  "let it run longer, or have the lamp seen to; what is measured now holds for a "
                  "short time"});
  const std::size_t last = std::min(kSettledReadings, readings.luminance.size());
  double white = 0;
  for (std::size_t i = readings.luminance.size() - last; i < readings.luminance.size(); ++i)
    white += readings.luminance[i] / static_cast<double>(last);
  if (const double before = earlier_white(context.journal); before > 0) {
    const double jump = white / before - 1;
    if (std::abs(jump) > kAbsurdJump)
      context.find({Finding::Severity::kFailure,
                    fmt::format("white is {:+.0f} % from what it was when this session was begun",
                                100 * jump),
                    "uncover the lens, point the instrument at the board, and do this step again"});
    else if (std::abs(jump) > kLargestJump)
      context.find({Finding::Severity::kWarning,
                    fmt::format("white is {:+.1f} % from what it was when this session was begun: "
                                "readings from before and after the break do not fit together",
                                100 * jump),
                    "begin again with --restart"});
  } else if (settled) {
    VENEER_TRY(context.journal.add("warm-up", "settled white", white));
  }
  context.report.summary =
      fmt::format("{} {:.1f} minutes: {:+.3f} % a minute, {:+.1f} % since the start",
                  settled ? "settled after" : "not settled after",
                  minutes,
                  100 * drift,
                  100 * (white / readings.luminance.front() - 1));
  return Answer::kDone;
}

}  // namespace veneer::calibration
