// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace veneer::projector {

/// One socket of a display card, and what is plugged into it.
struct KmsDisplay {
  std::string device;     ///< "/dev/dri/card0"
  std::string driver;     ///< of the card, such as "i915"
  std::string connector;  ///< "HDMI-A-1"
  bool connected = false;
  bool in_use = false;  ///< a picture goes there now, be it the text console
  std::string maker;    ///< from the EDID, as are the next two; empty where it says nothing
  std::string name;
  std::string serial;
  std::vector<std::string> modes;  ///< "1920x1080@60.00", as the display orders them
};

/// Every socket of every card that this program may open. A card that cannot be opened is an error
/// only if there is no other. Takes no display away from anybody.
/// Errors: kNotFound (no card), kIo (may not open it), kUnavailable.
[[nodiscard]] Result<std::vector<KmsDisplay>> kms_displays();

}  // namespace veneer::projector
