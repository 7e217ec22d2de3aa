// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/result.h"

namespace veneer::capture {

/// What turns the analyser, the polariser before the camera. One thread.
class Polariser {
 public:
  virtual ~Polariser() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  /// Turns until the analyser's axis is at this angle (see PolarisationAxes: 0 is parallel) and
  /// stands still. Errors: kTimeout, kDisconnected, kCancelled (the person who turns it wants to
  /// stop), kBadFormat (the stage reports a fault; the text says which and what to do).
  [[nodiscard]] virtual Status turn_to(double angle_rad) = 0;
};

}  // namespace veneer::capture
