// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/drivers/freed/freed_protocol.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// Where FreeD comes in; keys of the [tracker] table.
struct FreedOptions {
  /// The address of this machine that is listened at, in numbers; "::" for IPv6.
  std::string address = "0.0.0.0";
  /// What the sender was told. Sony's cameras have 40000. 1 to 65535.
  int port = 40000;
  /// Of one camera: its frame rate. 1 to 1000.
  double rate_hz = 50;
  /// Which axis of the world points up, "y" or "z" (FreedProtocol).
  FreedProtocol::Up up = FreedProtocol::Up::kY;

  /// Reads the keys and records what is out of range.
  [[nodiscard]] static FreedOptions read(TomlReader& toml);
};

/// Listens for FreeD over UDP; body n is camera n. Nothing is ever sent: stream mode is switched on
/// at the sender.
/// @param clock  borrowed; must outlive the tracker. Real: sockets know no other.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_freed(TomlReader& config, Clock& clock);

}  // namespace veneer::tracking
