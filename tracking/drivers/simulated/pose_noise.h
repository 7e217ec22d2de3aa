// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/random.h"
#include "base/rigid_transform.h"
#include "base/toml_reader.h"

namespace veneer::tracking {

/// How unsteadily a simulated tracker measures.
struct PoseNoise {
  double position_mm = 0;   ///< standard deviation of every coordinate. 0 to 1000
  double rotation_deg = 0;  ///< of every component of the rotation vector. 0 to 90
  /// Reads `noise_position_mm` and `noise_rotation_deg`, and records what is out of range.
  [[nodiscard]] static PoseNoise read(TomlReader& toml);
  [[nodiscard]] RigidTransform added_to(const RigidTransform& truth, Pcg32& random) const;
};

}  // namespace veneer::tracking
