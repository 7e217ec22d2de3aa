// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <span>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// The mean of the readings at drive 0; zero where there is none.
[[nodiscard]] Xyz mean_black(std::span<const PatchReading> readings);

/// What one channel alone sends, above black.
struct ChannelRamp {
  /// Rising, from 0 to 1.
  std::vector<double> drives;
  /// At each drive; 0 at the first. X, Y and Z never fall: noise in the dark is taken out with the
  /// nearest rising sequence.
  std::vector<Xyz> light;

  [[nodiscard]] const Xyz& full() const { return light.back(); }
};
using ChannelRamps = std::array<ChannelRamp, 3>;

/// Levels that a ramp must have above black, full drive among them.
inline constexpr int kFewestLevels = 3;
/// A ramp may fall by this part of its full output before it is not noise any more.
inline constexpr double kLargestFall = 0.02;

/// The readings with one channel driven, sorted; those of equal drive averaged.
/// Errors: kBadFormat: readings or drives that are not finite or not in [0, 1]; a channel without
/// full drive or with too few levels; a dead channel; a ramp that falls; readings of one drive
/// that contradict each other; primaries of which two have the same colour.
[[nodiscard]] Result<ChannelRamps> read_ramps(std::span<const PatchReading> patches,
                                              const Xyz& black);

/// The readings with at least two channels driven, less black, those of equal drive averaged;
/// sorted by drive. For patches that read_ramps() took.
[[nodiscard]] std::vector<PatchReading> read_mixtures(std::span<const PatchReading> patches,
                                                      const Xyz& black);

/// Different drives in `patches`.
[[nodiscard]] int count_drives(std::span<const PatchReading> patches);

/// XYZ of the primaries at full drive, along columns.
[[nodiscard]] Eigen::Matrix3d primaries_of(const ChannelRamps& ramps);

/// Whether the columns of `primaries` span XYZ well enough to be told apart: not zero, and at least
/// a thousandth of the volume that they would span at right angles.
[[nodiscard]] bool are_independent(const Eigen::Matrix3d& primaries);

/// How much an error in a reading weighs: lightness goes with the cube root of the light, so its
/// slope is light^(-2/3). @param light  in parts of full output, >= 0.
[[nodiscard]] double perceptual_weight(double light);

}  // namespace veneer::calibration
