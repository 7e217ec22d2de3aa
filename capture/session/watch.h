// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"
#include "capture/camera.h"

namespace veneer::capture {

/// How a picture differs from an earlier one of the same exposure, of the same thing.
struct Change {
  double light = 1;  ///< mean of the later over that of the earlier
  /// Difference over what noise makes, once the light is equal: about 1 where nothing moved.
  double movement = 1;

  [[nodiscard]] bool moved() const { return movement > kMoved; }
  [[nodiscard]] bool light_changed() const;
  /// The brightest twentieth of the differences of some thousand pixels varies by a few per cent;
  /// twice the noise is no chance.
  static constexpr double kMoved = 2;
};

/// @param again  the same as `first`, taken right after it: what differs is noise.
/// Errors: kBadFormat (sizes differ).
[[nodiscard]] Result<Change> change_since(const CameraFrame& first,
                                          const CameraFrame& again,
                                          const CameraFrame& later);

}  // namespace veneer::capture
