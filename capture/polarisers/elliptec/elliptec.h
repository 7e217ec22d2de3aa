// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/hands.h"
#include "capture/polariser.h"

namespace veneer::capture {

/// A rotation stage of Thorlabs' Elliptec series that turns the analyser.
struct ElliptecOptions {
  std::filesystem::path port;  ///< "/dev/serial/by-id/..."
  char address = '0';          ///< 0 to F
  double zero_deg = 0;         ///< position of the stage at which the analyser is parallel
  /// Growing positions turn the axis clockwise for who looks at the sample from the camera.
  bool reversed = false;
  bool home = true;  ///< seeks its mark first; without, its positions may be off since it was on
  Duration answer_time = std::chrono::seconds(2);
  Duration move_time = std::chrono::seconds(15);
};
/// Errors: those of SerialPort::open(), kTimeout (nothing answers), kBadFormat (the stage reports a
/// fault, or it is none), kInvalidOption (another address answers; no rotation stage).
[[nodiscard]] Result<std::unique_ptr<Polariser>> open_elliptec(const ElliptecOptions& options);
/// Reads port, address, zero_deg, reversed, home.
[[nodiscard]] Result<std::unique_ptr<Polariser>> open_elliptec_polariser(TomlReader& config,
                                                                         Hands& hands);

}  // namespace veneer::capture
