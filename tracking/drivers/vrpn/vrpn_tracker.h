// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// Which tracker of which server; keys of the [tracker] table.
struct VrpnOptions {
  /// A name or an address; an address needs no name server.
  std::string host = "localhost";
  /// 1 to 65535.
  int port = 3883;
  /// Its name on the server. Required.
  std::string tracker;
  /// Of one sensor. 1 to 10000.
  double rate_hz = 100;

  /// Reads the keys and records what is out of range.
  [[nodiscard]] static VrpnOptions read(TomlReader& toml);
};

/// Connects to a VRPN server; body n is sensor n.
/// @param clock  borrowed; must outlive the tracker. Real: sockets know no other.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_vrpn(TomlReader& config, Clock& clock);

}  // namespace veneer::tracking
