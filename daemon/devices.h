// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "projector/control.h"
#include "projector/output.h"
#include "render/renderer.h"
#include "render/scene.h"
#include "tracking/tracker.h"

namespace veneer::daemon {

/// How veneerd gets at what it works with, each called anew after a loss. Rehearsals put in others,
/// which fail when they are told to.
struct Devices {
  std::function<Result<std::unique_ptr<tracking::Tracker>>(Clock&)> open_tracker;
  std::function<Result<std::unique_ptr<projector::Output>>()> open_output;
  /// Empty where the projector cannot be asked.
  std::function<Result<std::unique_ptr<projector::ProjectorControl>>(Clock&)> open_control;
  std::function<Result<std::unique_ptr<render::Renderer>>(const render::Scene&,
                                                          std::span<const render::Level>,
                                                          const calibration::ProjectorProfile&,
                                                          const render::RendererOptions&,
                                                          const Scanout*)>
      make_renderer;
  /// Called by the frame loop before each frame, with its number and the time; may be empty. In
  /// virtual time it may call ServiceControl, which then does what it is told before it returns.
  std::function<void(std::uint64_t, Time)> before_frame;
  /// The part of the last seconds in which programs waited for memory, 0 to 1; where it is empty,
  /// what Linux says, and in virtual time nothing.
  std::function<Result<double>()> memory_pressure;
  /// How long the machine has slept so far; where it is empty, what Linux says, and in virtual time
  /// nothing.
  std::function<Duration()> time_asleep;
};

/// What is empty is taken from the configuration: its tables [tracker], [output] and [control] as
/// they were read, whatever became of the file since.
/// @param state_directory  of the daemon; the output's too, unless its table says another.
[[nodiscard]] Devices completed(Devices devices,
                                const TomlReader& toml,
                                const std::filesystem::path& state_directory);

}  // namespace veneer::daemon
