// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/additivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace veneer::calibration {
namespace {

using DriveKey = std::array<double, 3>;

struct Repeated {
  Xyz mean = Xyz::Zero();
  double count = 0;
};

using Readings = std::map<DriveKey, std::vector<Xyz>>;

Repeated average(const std::vector<Xyz>& readings) {
  Repeated result;
  for (const Xyz& xyz : readings) result.mean += xyz;
  result.count = static_cast<double>(readings.size());
  result.mean /= result.count;
  return result;
}

// The noise of one reading as a part of it, in each of X, Y and Z: pooled over all drives that were
// read more than once. 0 where none was.
double relative_noise(const Readings& readings) {
  double squares = 0;
  double freedoms = 0;
  for (const auto& [drive, repeats] : readings) {
    if (repeats.size() < 2) continue;
    const Xyz mean = average(repeats).mean;
    if (!(mean.minCoeff() > 0)) continue;
    for (const Xyz& xyz : repeats) squares += (xyz - mean).cwiseQuotient(mean).squaredNorm();
    freedoms += 3.0 * (static_cast<double>(repeats.size()) - 1.0);
  }
  return freedoms > 0 ? std::sqrt(squares / freedoms) : 0.0;
}

std::string reason_of(const Additivity& result) {
  const double percent = 100 * result.worst_error;
  const double uncertainty = 100 * result.uncertainty;
  if (!result.decisive)
    return fmt::format(
        "channels add up to {:+.1f} % (+-{:.1f} %) of the mixture: too noisy to tell; average more "
        "readings",
        percent,
        uncertainty);
  if (result.additive)
    return fmt::format("channels add up to within {:+.1f} % (+-{:.1f} %)", percent, uncertainty);
  return fmt::format("channels do not add up: their sum is {:+.1f} % (+-{:.1f} %) off the mixture",
                     percent,
                     uncertainty);
}

}  // namespace

Result<Additivity> test_additivity(std::span<const PatchReading> readings, const Xyz& black) {
  constexpr double kDeviations = 4.0;  // see kAdditivityMargin
  Readings by_drive;
  Xyz white = Xyz::Zero();
  for (const PatchReading& reading : readings) {
    if (!reading.drive.allFinite() || !reading.xyz.allFinite() || !black.allFinite())
      return fail(Errc::kBadFormat,
                  "testing additivity: a reading is not finite; read the patches again");
    by_drive[{reading.drive.x() + 0.0, reading.drive.y() + 0.0, reading.drive.z() + 0.0}].push_back(
        reading.xyz);
    if (reading.xyz.y() > white.y()) white = reading.xyz;
  }
  const double noise = relative_noise(by_drive);
  Additivity result;
  for (const auto& [drive, repeats] : by_drive) {
    const auto driven = std::ranges::count_if(drive, [](double d) { return d > 0; });
    if (driven < 2) continue;
    const Repeated mixture = average(repeats);
    Xyz sum = Xyz::Zero();
    Xyz variance = mixture.mean.cwiseAbs2() / mixture.count;
    bool complete = true;
    for (std::size_t c = 0; c < 3; ++c) {
      if (!(drive[c] > 0)) continue;
      DriveKey single{};
      single[c] = drive[c];
      const auto found = by_drive.find(single);
      complete = complete && found != by_drive.end();
      if (!complete) break;
      const Repeated channel = average(found->second);
      sum += channel.mean - black;
      variance += channel.mean.cwiseAbs2() / channel.count;
    }
    if (!complete) continue;
    const Xyz light = (mixture.mean - black).cwiseQuotient(white);
    const double most = light.maxCoeff();
    if (!(most > 0) || !(white.minCoeff() > 0))
      return fail(Errc::kBadFormat,
                  "testing additivity: the mixture at drive {:.3f}, {:.3f}, {:.3f} is not brighter "
                  "than black; check that the patches are shown",
                  drive[0],
                  drive[1],
                  drive[2]);
    const Xyz difference = sum.cwiseQuotient(white) - light;
    Eigen::Index component = 0;
    difference.cwiseAbs().maxCoeff(&component);
    result.mixtures.push_back(
        {{drive[0], drive[1], drive[2]},
         difference[component] / most,
         noise * std::sqrt(variance.cwiseQuotient(white.cwiseAbs2()).maxCoeff()) / most});
  }
  if (result.mixtures.empty())
    return fail(Errc::kBadFormat,
                "testing additivity: no mixture was read together with its channels alone; measure "
                "the patches of additivity_patches()");
  const MixtureError& worst = *std::ranges::max_element(
      result.mixtures, {}, [](const MixtureError& mixture) { return std::abs(mixture.error); });
  result.worst_error = worst.error;
  result.uncertainty = worst.uncertainty;
  result.additive = std::abs(worst.error) <= kAdditivityLimit;
  // What is off by far is off whatever the noise.
  result.decisive = kDeviations * worst.uncertainty <=
                    std::max(kAdditivityMargin, std::abs(std::abs(worst.error) - kAdditivityLimit));
  result.reason = reason_of(result);
  return result;
}

}  // namespace veneer::calibration
