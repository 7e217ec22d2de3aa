// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/ramps.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string_view>

#include "calibration/interpolation.h"

namespace veneer::calibration {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};
/// Readings of one drive may lie this far apart, in parts of the brightest reading of all.
constexpr double kLargestContradiction = 0.1;

using DriveKey = std::array<double, 3>;

struct Average {
  Xyz sum = Xyz::Zero();
  Xyz least = Xyz::Constant(HUGE_VAL);
  Xyz most = Xyz::Constant(-HUGE_VAL);
  int count = 0;
};

std::map<DriveKey, Average> averages_of(std::span<const PatchReading> patches) {
  std::map<DriveKey, Average> averages;
  for (const PatchReading& patch : patches) {
    // + 0.0 makes one key of 0 and -0.
    Average& average =
        averages[{patch.drive.x() + 0.0, patch.drive.y() + 0.0, patch.drive.z() + 0.0}];
    average.sum += patch.xyz;
    average.least = average.least.cwiseMin(patch.xyz);
    average.most = average.most.cwiseMax(patch.xyz);
    ++average.count;
  }
  return averages;
}

int driven_channels(const DriveKey& drive) {
  return static_cast<int>(std::ranges::count_if(drive, [](double d) { return d > 0.0; }));
}

Status check_patches(std::span<const PatchReading> patches, const Xyz& black) {
  if (!black.allFinite())
    return fail(Errc::kBadFormat, "fitting a colour model: black is not finite; read it again");
  for (const PatchReading& patch : patches) {
    if (!patch.drive.allFinite() || patch.drive.minCoeff() < 0.0 || patch.drive.maxCoeff() > 1.0)
      return fail(Errc::kBadFormat,
                  "fitting a colour model: a drive of {}, {}, {} is not in [0, 1]; check the list "
                  "of patches",
                  patch.drive.x(),
                  patch.drive.y(),
                  patch.drive.z());
    if (!patch.xyz.allFinite())
      return fail(Errc::kBadFormat,
                  "fitting a colour model: the reading at drive {}, {}, {} is not finite; read it "
                  "again",
                  patch.drive.x(),
                  patch.drive.y(),
                  patch.drive.z());
  }
  return {};
}

Status check_contradictions(const std::map<DriveKey, Average>& averages) {
  double brightest = 0.0;
  for (const auto& [drive, average] : averages)
    brightest = std::max(brightest, average.most.maxCoeff());
  for (const auto& [drive, average] : averages) {
    const double apart = (average.most - average.least).maxCoeff();
    if (apart > kLargestContradiction * brightest)
      return fail(Errc::kBadFormat,
                  "fitting a colour model: readings at drive {}, {}, {} lie {:.3g} cd/m^2 apart; "
                  "was something in the light? measure again",
                  drive[0],
                  drive[1],
                  drive[2],
                  apart);
  }
  return {};
}

Status check_rises(const ChannelRamp& ramp, std::string_view channel) {
  const double full = ramp.full().sum();
  double highest = 0.0;
  for (std::size_t i = 0; i < ramp.light.size(); ++i) {
    const double light = ramp.light[i].sum();
    if (highest - light > kLargestFall * full)
      return fail(Errc::kBadFormat,
                  "fitting a colour model: the {} ramp falls by {:.1f} % of its full output at "
                  "drive {:.3f}; switch off what adapts the picture and measure again",
                  channel,
                  100 * (highest - light) / full,
                  ramp.drives[i]);
    highest = std::max(highest, light);
  }
  return {};
}

void make_rising(ChannelRamp& ramp) {
  for (Eigen::Index component = 0; component < 3; ++component) {
    std::vector<double> values;
    values.reserve(ramp.light.size());
    for (const Xyz& light : ramp.light) values.push_back(light[component]);
    // Black is averaged and counts as exact: what noise has put below it is zero.
    for (double& value : values) value = std::max(value, 0.0);
    values = nearest_rising(values);
    for (std::size_t i = 0; i < values.size(); ++i) ramp.light[i][component] = values[i];
    ramp.light.front()[component] = 0.0;
  }
}

}  // namespace

Xyz mean_black(std::span<const PatchReading> readings) {
  Xyz sum = Xyz::Zero();
  int count = 0;
  for (const PatchReading& reading : readings) {
    if (!reading.drive.isZero(0.0)) continue;
    sum += reading.xyz;
    ++count;
  }
  return count > 0 ? Xyz(sum / count) : sum;
}

Result<ChannelRamps> read_ramps(std::span<const PatchReading> patches, const Xyz& black) {
  VENEER_TRY(check_patches(patches, black));
  const std::map<DriveKey, Average> averages = averages_of(patches);
  VENEER_TRY(check_contradictions(averages));
  ChannelRamps ramps;
  for (ChannelRamp& ramp : ramps) ramp = {{0.0}, {Xyz::Zero()}};
  // The map is sorted, so each channel's drives come rising.
  for (const auto& [drive, average] : averages) {
    if (driven_channels(drive) != 1) continue;
    const auto channel = static_cast<std::size_t>(std::ranges::max_element(drive) - drive.begin());
    ramps[channel].drives.push_back(drive[channel]);
    ramps[channel].light.push_back(average.sum / average.count - black);
  }
  double brightest = 0.0;
  for (const ChannelRamp& ramp : ramps) brightest = std::max(brightest, ramp.light.back().sum());
  for (std::size_t c = 0; c < 3; ++c) {
    ChannelRamp& ramp = ramps[c];
    const auto levels = static_cast<int>(ramp.drives.size()) - 1;
    if (levels < kFewestLevels || ramp.drives.back() != 1.0)
      return fail(
          Errc::kBadFormat,
          "fitting a colour model: the {} ramp has {} levels {} full drive; {} or more with "
          "full drive are needed: measure the missing ones",
          kChannelNames[c],
          levels,
          ramp.drives.back() == 1.0 ? "with" : "without",
          kFewestLevels);
    // Blue has the least light: about a thirtieth of the luminance, but much of Z.
    constexpr double kDead = 1e-3;
    if (!(ramp.full().sum() > kDead * brightest))
      return fail(Errc::kBadFormat,
                  "fitting a colour model: {} sends no light at full drive; check the cable and "
                  "the projector's colour mode",
                  kChannelNames[c]);
    VENEER_TRY(check_rises(ramp, kChannelNames[c]));
    make_rising(ramp);
  }
  if (!are_independent(primaries_of(ramps)))
    return fail(Errc::kBadFormat,
                "fitting a colour model: two primaries have the same colour; check the projector's "
                "colour mode");
  return ramps;
}

std::vector<PatchReading> read_mixtures(std::span<const PatchReading> patches, const Xyz& black) {
  std::vector<PatchReading> mixtures;
  for (const auto& [drive, average] : averages_of(patches)) {
    if (driven_channels(drive) < 2) continue;
    mixtures.push_back({{drive[0], drive[1], drive[2]}, average.sum / average.count - black});
  }
  return mixtures;
}

int count_drives(std::span<const PatchReading> patches) {
  std::set<DriveKey> drives;
  for (const PatchReading& patch : patches)
    drives.insert({patch.drive.x() + 0.0, patch.drive.y() + 0.0, patch.drive.z() + 0.0});
  return static_cast<int>(drives.size());
}

Eigen::Matrix3d primaries_of(const ChannelRamps& ramps) {
  Eigen::Matrix3d primaries;
  for (std::size_t c = 0; c < 3; ++c) primaries.col(static_cast<Eigen::Index>(c)) = ramps[c].full();
  return primaries;
}

bool are_independent(const Eigen::Matrix3d& primaries) {
  constexpr double kLeastVolume = 1e-3;
  const Eigen::RowVector3d lengths = primaries.colwise().norm();
  return primaries.allFinite() &&
         std::abs(primaries.determinant()) > kLeastVolume * lengths.prod() &&
         lengths.minCoeff() > 0;
}

double perceptual_weight(double light) {
  // Below a hundredth of full output the slope of L* stops growing.
  constexpr double kLinearPart = 0.01;
  return std::pow(light + kLinearPart, -2.0 / 3.0);
}

}  // namespace veneer::calibration
