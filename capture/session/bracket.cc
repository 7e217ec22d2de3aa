// SPDX-License-Identifier: Apache-2.0
#include "capture/session/bracket.h"

#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace veneer::capture {
namespace {

/// Of the pixels' brightest channels, of full scale.
double level_at(const CameraFrame& frame, double rank) {
  std::vector<double> brightest;
  brightest.reserve(frame.counts.pixels().size());
  for (const Rgb16& pixel : frame.counts.pixels())
    brightest.push_back(*std::ranges::max_element(pixel));
  return quantile(std::move(brightest), rank) / std::max<double>(frame.full_scale, 1);
}

// What is looked for changes by the light at most; a dozen pictures span any camera's range.
constexpr int kMostProbes = 12;

}  // namespace

double ExposureChoice::at_most(double seconds) const {
  const double cut = std::clamp(seconds, range.least_s, range.most_s);
  if (multiple_of_s <= 0) return cut;
  // 0.03 / 0.01 is a little less than 3.
  constexpr double kRounding = 1e-9;
  const double least = std::max(std::ceil(range.least_s / multiple_of_s - kRounding), 1.0);
  return std::max(std::floor(cut / multiple_of_s + kRounding), least) * multiple_of_s;
}

Status ExposureChoice::check() const {
  if (!(range.least_s >= 0) || !(range.most_s > 0) || !(range.least_s <= range.most_s) ||
      !std::isfinite(range.most_s))
    return fail(Errc::kInvalidOption,
                "the camera's exposures go from {} s to {} s, which is no range",
                range.least_s,
                range.most_s);
  if (at_most(range.least_s) <= range.most_s * (1 + 1e-9)) return {};
  return fail(Errc::kInvalidOption,
              "no whole multiple of exposure.multiple_of_s ({} s) is among the camera's exposures, "
              "{} s to {} s",
              multiple_of_s,
              range.least_s,
              range.most_s);
}

Result<ProbedExposure> longest_unsaturated(const Expose& expose,
                                           const ExposureChoice& choice,
                                           double start_s) {
  constexpr double kWanted = 0.8;  // noise has room above it
  constexpr double kEnough = 0.5;
  constexpr double kFull = 0.95;  // from here on the level says no more than that it is too much
  double exposure = choice.at_most(start_s);
  double longest_good = 0;
  double shortest_bad = choice.range.most_s * 2;
  for (int probe = 0; probe < kMostProbes; ++probe) {
    VENEER_ASSIGN(const CameraFrame frame, expose(exposure));
    const double level = level_at(frame, 1 - kAllowedSaturation);
    if (level < kFull) longest_good = std::max(longest_good, exposure);
    if (level >= kFull) shortest_bad = std::min(shortest_bad, exposure);
    if (level >= kEnough && level < kFull) break;
    const double factor = level >= kFull ? 0.25 : std::min(kWanted / std::max(level, 1e-6), 16.0);
    double next = exposure * factor;
    // Between what was too much and what was not.
    if (longest_good > 0 && (next >= shortest_bad || next <= longest_good) &&
        shortest_bad <= choice.range.most_s)
      next = std::sqrt(longest_good * shortest_bad);
    next = choice.at_most(next);
    if (next == exposure || next == longest_good) break;
    exposure = next;
  }
  if (longest_good > 0) return ProbedExposure{longest_good, true};
  return ProbedExposure{choice.at_most(choice.range.least_s), false};
}

Result<ProbedExposure> shortest_dim_enough(const Expose& expose,
                                           const ExposureChoice& choice,
                                           double start_s,
                                           double most_s) {
  double exposure = choice.at_most(std::min(start_s, most_s));
  double level = 0;
  for (int probe = 0; probe < kMostProbes; ++probe) {
    VENEER_ASSIGN(const CameraFrame frame, expose(exposure));
    level = level_at(frame, 0.1);
    if (level >= kDimEnough && level < 2 * kDimEnough) break;
    // Light that has saturated says only that it is less.
    const double factor =
        level > 0.9 ? 0.1 : std::min(1.2 * kDimEnough / std::max(level, 1e-6), 16.0);
    const double next = choice.at_most(std::min(exposure * factor, most_s));
    if (next == exposure) break;
    exposure = next;
  }
  return ProbedExposure{exposure, level >= kDimEnough};
}

std::vector<double> bracket_between(double shortest_s,
                                    double longest_s,
                                    const ExposurePlan& plan,
                                    const ExposureChoice& choice) {
  std::vector<double> bracket{choice.at_most(shortest_s)};
  double wanted = bracket[0];
  while (static_cast<int>(bracket.size()) < plan.most && bracket.back() < longest_s) {
    wanted *= plan.step;
    // Half a multiple up: rounded down, a step could come to nothing.
    const double next = choice.at_most(wanted + choice.multiple_of_s / 2);
    if (next <= bracket.back()) break;  // the end of the camera's range
    bracket.push_back(next);
  }
  return bracket;
}

}  // namespace veneer::capture
