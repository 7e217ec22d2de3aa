// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/colour/colour_model.h"
#include "calibration/colour/selection.h"

namespace veneer::calibration {

/// What is wrong with an invented projector, as parts.
struct LadderDefects {
  /// Of a channel's light that has turned to white at drive 0; none at full drive.
  double drift = 0;
  /// Of full white that a white segment adds to it; it follows the least of the linear drives.
  double white_segment = 0;
  /// Of its light that a channel loses while the other two are at full drive, by the root mean
  /// square of their linear drives.
  double crosstalk = 0;
};

/// An invented projector without any noise, to measure models on; no claim about hardware. 290
/// cd/m^2 of white, black 0.26 % of it and bluish, a tone curve per channel between a power and an
/// S, primaries of its own.
class LadderProjector {
 public:
  explicit LadderProjector(const LadderDefects& defects) : defects_(defects) {}
  /// XYZ with black. @param drive  in [0, 1]^3.
  [[nodiscard]] Xyz light(const Eigen::Vector3d& drive) const;
  [[nodiscard]] Xyz black() const { return light(Eigen::Vector3d::Zero()); }
  [[nodiscard]] Xyz white() const { return light(Eigen::Vector3d::Ones()); }
  /// Readings of patches: X, Y and Z each off by `noise` of itself, normally distributed.
  [[nodiscard]] std::vector<PatchReading> read(std::span<const Rgb16> patches,
                                               int bits,
                                               double noise,
                                               std::uint64_t seed) const;

 private:
  LadderDefects defects_;
};

/// A rung: one projector, measured with so many patches.
struct LadderRung {
  std::string_view defect;
  LadderDefects defects;
  int ramp_levels = 16;  ///< black left out: 3 ramp_levels + 4 patches
};
/// Every rung of the benchmark.
[[nodiscard]] std::span<const LadderRung> ladder_rungs();

struct LadderResult {
  std::string_view defect;
  int ramp_patches = 0;
  int interaction_patches = 0;  ///< besides, for the models of interaction
  int additive_verdicts = 0;    ///< of kLadderDraws
  double additivity_error = 0;  ///< the mean over the draws
  /// By family: dE00 from the projector itself over kLadderColours random drives, each figure the
  /// mean over the draws.
  std::vector<ColourCandidate> models;
  /// Of what select_colour_model() took, by its own verification patches.
  std::string chosen;  ///< the names that it took, the most frequent first
  ColourError chosen_error;
};

inline constexpr double kLadderNoise = 0.003;
inline constexpr int kLadderColours = 1000;
/// Draws of the noise that figures are averaged over: a maximum of one draw tells little.
inline constexpr int kLadderDraws = 8;

/// Measures one rung. Errors: those of the fits and of selection, which are ours.
[[nodiscard]] Result<LadderResult> climb(const LadderRung& rung);

}  // namespace veneer::calibration
