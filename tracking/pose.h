// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>

#include "base/clock.h"
#include "base/rigid_transform.h"

namespace veneer::tracking {

/// Which tracked body: a station of a magnetic tracker, a rigid body of an optical one.
using BodyId = int;

/// One measurement of one body.
struct PoseSample {
  BodyId body = 0;
  /// The moment that was measured (exposure mid-point), CLOCK_MONOTONIC.
  Time time;
  RigidTransform world_from_body;
  /// Grows by one with every sample that the device sent for this body; gaps are lost samples.
  std::uint64_t sequence = 0;
  /// Samples of different epochs are not to be compared: in between the device's clock began anew,
  /// or the body jumped.
  std::uint32_t epoch = 0;
};

/// How a pose for a moment was found.
enum class PoseOrigin {
  kNone,          ///< nothing was ever measured
  kInterpolated,  ///< between two samples
  kPredicted,     ///< beyond the newest sample, within the prediction limit
  kHeld,          ///< too far beyond it: velocities have decayed
};

/// A pose at a moment that somebody asked for.
struct PoseEstimate {
  PoseOrigin origin = PoseOrigin::kNone;
  RigidTransform world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< m/s in the world frame
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< rad/s in the body frame
  /// From the newest sample to the moment asked for; negative where that lies in the past.
  Duration age{};
};

}  // namespace veneer::tracking
