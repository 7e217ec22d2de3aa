// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <mutex>
#include <string>

#include "daemon/devices.h"
#include "tests/soak/display.h"
#include "tests/soak/injections.h"

namespace veneer::soak {

/// What the renderers of a run were asked for that no scene can be drawn for.
struct DrawLaws {
  std::atomic<std::uint64_t> draws{0};
  std::atomic<std::uint64_t> not_finite{0};  ///< an eye, an object or a weight
  /// The share of the highlights in the last frame.
  std::atomic<double> specular_weight{0};
  std::atomic<std::uint64_t> renderers{0};  ///< made
  std::atomic<bool> control_opened{false};  ///< somebody watches the projector
};

/// The devices of a rehearsal: the simulated tracker that the configuration describes, the real
/// renderer, a display that is metered and a projector that can be asked, each failing as the
/// switches say.
/// @param switches, display, laws  borrowed; must outlive the daemon.
/// @param clock  set to the daemon's own as soon as it is known.
[[nodiscard]] daemon::Devices faulty_devices(const std::filesystem::path& config,
                                             double frame_rate_hz,
                                             Switches& switches,
                                             Display& display,
                                             DrawLaws& laws,
                                             std::atomic<Clock*>& clock);

}  // namespace veneer::soak
