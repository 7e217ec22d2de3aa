// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer::capture {

/// One entry of a camera's list of shutter speeds.
struct ShutterSpeed {
  std::string name;  ///< as the camera writes it
  double seconds = 0;
};

/// Seconds of "1/125", "0.5", "0.0080s", "30", "13/10", "1.3 s"; nothing for what names no time
/// ("bulb", "auto", "Time") or one that is not above 0 and finite.
[[nodiscard]] std::optional<double> shutter_seconds(std::string_view name);
/// Those of a camera's list that name a time, from the shortest to the longest.
[[nodiscard]] std::vector<ShutterSpeed> shutter_speeds(std::span<const std::string> names);
/// The one that is nearest in ratio. Errors: kInvalidOption (out of the range, which is named; not
/// a time), kUnavailable (no speeds).
[[nodiscard]] Result<ShutterSpeed> nearest_speed(std::span<const ShutterSpeed> speeds,
                                                 double seconds);

}  // namespace veneer::capture
