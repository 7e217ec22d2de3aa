// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace veneer::projector {

/// One screen of the desktop: a monitor or a projector.
struct Display {
  int number = 0;    ///< as the window output's key `display` takes it
  std::string name;  ///< as the system has it, such as "HDMI-1"
  int x = 0, y = 0;  ///< of its upper left corner on the desktop, pixels
  int width = 0;     ///< pixels
  int height = 0;
  double refresh_hz = 0;  ///< 0 where the system does not say
};

/// Every screen of the desktop that this program runs on. Errors: kUnavailable (no desktop).
[[nodiscard]] Result<std::vector<Display>> list_displays();

}  // namespace veneer::projector
