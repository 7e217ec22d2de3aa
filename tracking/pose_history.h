// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "base/result.h"
#include "tracking/pose.h"

namespace veneer::tracking {

/// What one body did over a whole session, to be measured afterwards; for what is asked while it
/// moves there is PoseTrack.
class PoseHistory {
 public:
  /// Takes a sample and makes its quaternion a unit one on the side of the one before. Drops, and
  /// counts, one that is not finite, whose quaternion is not of unit length within 10 %, or that
  /// was not measured after the one before. Returns whether it was taken.
  bool add(const PoseSample& sample);

  [[nodiscard]] const std::vector<PoseSample>& samples() const& { return samples_; }
  void samples() const&& = delete;  // they would be gone
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

  /// The straight line through the samples around a moment, at that moment.
  struct LocalFit {
    int samples = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres
    Eigen::Vector4d rotation = Eigen::Vector4d::Zero();  ///< x, y, z, w; nearly of unit length
    double speed_m_s = 0;
    double turning_rad_s = 0;
    /// Standard deviation of the samples about the line, of a coordinate.
    double position_spread_m = 0;
    double rotation_spread_rad = 0;
    /// That of a spread of 1 in the fitted value: below 1 where samples outnumber unknowns.
    double gain = 1;
  };
  /// Weights fall off smoothly to 0 at `half_width` ("biweight"), so that noise is damped alike
  /// wherever the moment lies between samples: nothing draws a shift of time to one phase.
  /// Nothing where fewer than four samples or samples of several epochs lie within, or all of them
  /// on one side of the moment.
  /// Source: Cleveland 1979, "Robust Locally Weighted Regression and Smoothing Scatterplots", with
  /// his other weights in place of the tricube.
  [[nodiscard]] std::optional<LocalFit> fit_at(Time when, Duration half_width) const;

 private:
  std::vector<PoseSample> samples_;
  std::uint64_t dropped_ = 0;
};

/// Every body of a recording. Errors: those of PoseRecordingReader.
[[nodiscard]] Result<std::map<BodyId, PoseHistory>> read_histories(
    const std::filesystem::path& recording);
/// One of them. Errors: also kNotFound, which names the bodies that there are.
[[nodiscard]] Result<PoseHistory> read_history(const std::filesystem::path& recording, BodyId body);

}  // namespace veneer::tracking
