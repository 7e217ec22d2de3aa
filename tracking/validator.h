// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <optional>

#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/pose.h"

namespace veneer::tracking {

/// What a body can do; keys of the [validation] table.
struct ValidationOptions {
  double speed_m_s = 10;     ///< faster than any head. > 0
  double turn_rad_s = 30;    ///< > 0
  double tolerance_mm = 10;  ///< what noise alone may do between two samples. >= 0
  double tolerance_deg = 2;  ///< likewise. >= 0
  /// Where a body can be: a box in the world, corner to corner; anywhere where it is not given.
  std::optional<Eigen::Vector3d> least_m;
  std::optional<Eigen::Vector3d> most_m;
  /// Reads the keys and records what is out of range.
  [[nodiscard]] static ValidationOptions read(TomlReader& toml);
};

/// Holds each sample of one body against the one before: what no body can do was not measured.
///
/// One sample that is too far from the last believed one is dropped. When the next lies where that
/// one lay, the body really is elsewhere (it was carried while nobody saw, the tracker has found
/// its hemisphere again): it is believed, and an epoch begins.
class Validator {
 public:
  explicit Validator(const ValidationOptions& options) : options_(options) {}

  enum class Verdict {
    kValid,
    kInvalid,  ///< not finite, no rotation (length beyond 0.9 to 1.1), outside the box
    kOutlier,  ///< too far from the last believed sample, for the first time
  };
  /// Adds the epochs begun here to that of the sample.
  [[nodiscard]] Verdict check(PoseSample& sample);

 private:
  [[nodiscard]] bool is_pose(const PoseSample& sample) const;
  /// Whether a body can get from one to the other.
  [[nodiscard]] bool reaches(const PoseSample& from, const PoseSample& to) const;

  ValidationOptions options_;
  std::optional<PoseSample> believed_;
  std::optional<PoseSample> outlier_;  // the sample before, if it was one
  std::uint32_t jumps_ = 0;
};

}  // namespace veneer::tracking
