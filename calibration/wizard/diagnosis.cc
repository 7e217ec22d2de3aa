// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace veneer::calibration {
namespace {

/// Of readings of the dark: what a good instrument still tells from nothing, cd/m^2.
constexpr double kDarkNits = 0.02;
/// Ambient light over this part of white makes dark colours unreachable.
constexpr double kMuchAmbient = 0.02;
/// Readings of a steady light scatter by less.
constexpr double kSteadyRoom = 0.02;

struct Line {
  double slope = std::nan("");  // a second
  double mean = std::nan("");   // at the middle
  double slope_error = std::numeric_limits<double>::infinity();
};

Line line_through_the_last(const WarmUp& readings, double window_s) {
  Line line;
  if (readings.seconds.empty()) return line;
  const double from = readings.seconds.back() - window_s;
  std::vector<double> t;
  std::vector<double> y;
  for (std::size_t i = 0; i < readings.seconds.size(); ++i) {
    if (readings.seconds[i] < from) continue;
    t.push_back(readings.seconds[i]);
    y.push_back(readings.luminance[i]);
  }
  if (t.size() < 3) return line;
  const auto n = static_cast<double>(t.size());
  double mean_t = 0;
  double mean_y = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    mean_t += t[i] / n;
    mean_y += y[i] / n;
  }
  double tt = 0;
  double ty = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    tt += (t[i] - mean_t) * (t[i] - mean_t);
    ty += (t[i] - mean_t) * (y[i] - mean_y);
  }
  if (!(tt > 0)) return line;
  line.slope = ty / tt;
  line.mean = mean_y;
  double rest = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double off = y[i] - mean_y - line.slope * (t[i] - mean_t);
    rest += off * off;
  }
  if (t.size() > 3) line.slope_error = std::sqrt(rest / (n - 2) / tt);
  return line;
}

}  // namespace

std::vector<Finding> diagnose_picture(const Xyz& black, const Xyz& white, double noise) {
  const double step = white.y() - black.y();
  const double least = std::max(kDarkNits, 5 * noise * std::abs(white.y()));
  if (!(step > least))
    return {
        {Finding::Severity::kFailure,
         fmt::format("white reads {:.3g} cd/m^2 and black {:.3g}: what the instrument looks at "
                     "does not change with the picture",
                     white.y(),
                     black.y()),
         "the pattern is on the wrong screen, the lens is covered, or the instrument looks past "
         "the board: look at the board, and pick another display"}};
  if (black.y() > 0 && white.y() / black.y() < 10)
    return {{Finding::Severity::kWarning,
             fmt::format("white is only {:.1f} times as bright as black", white.y() / black.y()),
             "darken the room, or check that the instrument sees nothing but the board"}};
  return {};
}

double effective_gamma(const GreyRamp& ramp) {
  const double full = ramp.luminance.empty() ? 0 : ramp.luminance.back();
  if (!(full > 0)) return std::nan("");
  // ln t = g ln d, through (1, 1).
  double above = 0;
  double below = 0;
  int count = 0;
  for (std::size_t i = 0; i < ramp.drive.size(); ++i) {
    const double t = ramp.luminance[i] / full;
    if (!(t > 0.02 && t < 0.98 && ramp.drive[i] > 0 && ramp.drive[i] < 1)) continue;
    above += std::log(t) * std::log(ramp.drive[i]);
    below += std::log(ramp.drive[i]) * std::log(ramp.drive[i]);
    ++count;
  }
  return count < 3 ? std::nan("") : above / below;
}

std::vector<Finding> diagnose_ramp(const GreyRamp& ramp) {
  using Severity = Finding::Severity;
  std::vector<Finding> findings;
  const std::size_t n = ramp.drive.size();
  if (n < 4 || !(ramp.luminance.back() > 0)) return findings;
  const double full = ramp.luminance.back();
  const auto output = [&](std::size_t i) { return ramp.luminance[i] / full; };
  const double same = std::max(3 * ramp.noise, 1e-4);

  for (std::size_t i = 1; i < n; ++i) {
    if (output(i - 1) - output(i) > std::max(0.02, 5 * ramp.noise)) {
      findings.push_back(
          {Severity::kFailure,
           fmt::format("from drive {:.3f} to {:.3f} the light falls by {:.1f} % of full",
                       ramp.drive[i - 1],
                       ramp.drive[i],
                       100 * (output(i - 1) - output(i))),
           "switch dynamic contrast, dynamic iris and noise reduction off, and let the lamp warm "
           "up"});
      break;
    }
  }
  // The last level that is as bright as full, with another below it that is not.
  std::size_t first_full = n - 1;
  while (first_full > 0 && output(first_full - 1) > 1 - same) --first_full;
  // A curve of exponent 2.2 is at 1 - same only within same / 2.2 of full drive.
  const bool cut_above = ramp.drive[first_full] < 1 - 2 * same - 0.01;
  // A pure curve of exponent 3 is still at 2.4e-4 of full at 16 of 255; what is truly cut off gives
  // nothing at all.
  std::size_t last_dark = 0;
  while (last_dark + 1 < n && ramp.luminance[last_dark + 1] < 2e-5 * full + 1e-4) ++last_dark;
  const bool cut_below = ramp.drive[last_dark] > 0.03;
  if (cut_above && cut_below) {
    findings.push_back(
        {Severity::kWarning,
         fmt::format(
             "drives up to {:.3f} are black and from {:.3f} on all are white: the picture is "
             "sent or taken as limited range (16 to 235)",
             ramp.drive[last_dark],
             ramp.drive[first_full]),
         "set the range to full on both ends (\"Broadcast RGB\" = Full, HDMI level = expanded or "
         "PC)"});
  } else if (cut_above) {
    findings.push_back(
        {Severity::kWarning,
         fmt::format("from drive {:.3f} on all are as bright as white", ramp.drive[first_full]),
         "turn the projector's contrast down until they differ, then begin again"});
  } else if (cut_below) {
    findings.push_back(
        {Severity::kWarning,
         fmt::format("drives up to {:.3f} give no light at all", ramp.drive[last_dark]),
         "turn the projector's brightness up until they differ, then begin again"});
  }
  const double gamma = effective_gamma(ramp);
  if (gamma < 1.3) {
    findings.push_back(
        {Severity::kNote,
         fmt::format("the light follows the code nearly in proportion (exponent "
                     "{:.2f}): the projector's own gamma is off",
                     gamma),
         "fine for patterns; with 8 bits dark colours will show steps, so a gamma of "
         "about 2.2 is better for pictures (DLPC350: degamma table)"});
  } else if (gamma > 3.2) {
    findings.push_back(
        {Severity::kWarning,
         fmt::format("the curve is steep (exponent {:.2f}): gamma is applied twice, or a picture "
                     "mode bends it",
                     gamma),
         "choose the projector's plainest picture mode, and switch a second gamma off (DLPC350: "
         "degamma table on, and a gamma in the graphics driver)"});
  }
  return findings;
}

double drift_per_minute(const WarmUp& readings, double window_s) {
  const Line line = line_through_the_last(readings, window_s);
  return 60 * line.slope / line.mean;
}

double drift_error_per_minute(const WarmUp& readings, double window_s) {
  const Line line = line_through_the_last(readings, window_s);
  return 60 * line.slope_error / std::abs(line.mean);
}

Repeatability repeatability(std::span<const Xyz> readings) {
  Repeatability result;
  if (readings.empty()) return result;
  const auto n = static_cast<double>(readings.size());
  for (const Xyz& xyz : readings) result.mean += xyz / n;
  if (readings.size() < 2) return result;
  Xyz squares = Xyz::Zero();
  for (const Xyz& xyz : readings) squares += (xyz - result.mean).cwiseAbs2();
  result.deviation = (squares / (n - 1)).cwiseSqrt();
  int positive = 0;
  for (int i = 0; i < 3; ++i) {
    if (!(result.mean[i] > 0)) continue;
    result.relative += result.deviation[i] / result.mean[i];
    ++positive;
  }
  if (positive > 0) result.relative /= positive;
  return result;
}

std::vector<Finding> diagnose_room(const Repeatability& ambient, const Repeatability& white) {
  using Severity = Finding::Severity;
  std::vector<Finding> findings;
  const double part = ambient.mean.y() / white.mean.y();
  if (part > kMuchAmbient)
    findings.push_back(
        {Severity::kWarning,
         fmt::format("the room's light is {:.1f} % of white: colours darker than that "
                     "cannot be shown",
                     100 * part),
         "darken the room"});
  if (ambient.mean.y() > 10 * kDarkNits && ambient.deviation.y() > kSteadyRoom * ambient.mean.y())
    findings.push_back({Severity::kWarning,
                        fmt::format("the room's light changes by {:.1f} % from reading to reading",
                                    100 * ambient.deviation.y() / ambient.mean.y()),
                        "switch flickering lamps off, draw the curtains, and do not walk past"});
  return findings;
}

}  // namespace veneer::calibration
