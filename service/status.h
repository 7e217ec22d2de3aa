// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"

namespace veneer::service {

/// What veneerd is doing, worst last. docs/reliability.md says what the audience sees in each.
enum class State {
  kStarting,  ///< dark; nothing was shown yet
  kRunning,   ///< all is well
  kDegraded,  ///< a picture, but not the whole of it; the faults say why
  kBlank,     ///< dark, because somebody asked for it or nothing better can be shown for a while
  kFault,     ///< dark, and it does not get better by itself soon
  kStopping,
};
inline constexpr std::size_t kStateCount = 6;
[[nodiscard]] std::string_view name_of(State state);
/// The inverse of name_of(); nothing where no state is named so.
[[nodiscard]] std::optional<State> state_named(std::string_view name);

/// What can be wrong. Each kind stands once in the list of faults, from when it began until it is
/// over.
enum class FaultKind {
  kTracker,         ///< no poses come
  kOutput,          ///< the display is gone, or refuses frames
  kGpu,             ///< the GPU has lost all that it held
  kProfile,         ///< a new profile was refused, or the folder is gone; the old one stays
  kMaterial,        ///< likewise
  kScene,           ///< likewise
  kConfiguration,   ///< likewise
  kDisk,            ///< something could not be written
  kProjector,       ///< it cannot be asked how it is doing
  kProjectorState,  ///< it is not as it was when the profile was measured
  kLate,            ///< most frames of the last seconds came too late
  kMemory,          ///< the machine has little left
};
inline constexpr std::size_t kFaultKindCount = 12;
[[nodiscard]] std::string_view name_of(FaultKind kind);
[[nodiscard]] std::optional<FaultKind> fault_kind_named(std::string_view name);
/// The state that a fault of this kind brings at least.
[[nodiscard]] State effect_of(FaultKind kind);
/// Once the cause has gone, the fault is over after no more than this; stated in
/// docs/reliability.md and held by its tests.
[[nodiscard]] Duration recovery_time_of(FaultKind kind);

struct Fault {
  FaultKind kind = FaultKind::kTracker;
  Time since;
  std::string text;  ///< what was being done, what went wrong, what to do
  bool operator==(const Fault&) const = default;
};

/// Where the time from a pose to its light went: medians over the last second, milliseconds.
struct LatencyBudget {
  double tracker = 0;     ///< from the sample's time stamp to its arrival here
  double hand_off = 0;    ///< from its arrival until the frame loop could read it
  double wait = 0;        ///< from then until a frame took it up
  double draw = 0;        ///< what the frame loop's thread computes: processor time, no waits
  double gpu_draw = 0;    ///< the GPU's draw pass, and what is waited for it beyond both passes
  double compensate = 0;  ///< the GPU's compensate pass
  double present = 0;     ///< handing the frame to the output
  double display = 0;     ///< from there to the light, as the output says or as is configured
  [[nodiscard]] double total() const {
    return tracker + hand_off + wait + draw + gpu_draw + compensate + present + display;
  }
  bool operator==(const LatencyBudget&) const = default;
};

/// A stage by its name, in the order in which a pose goes through them: what lists the stages (the
/// bus, metrics, tables) goes by this.
struct LatencyStage {
  std::string_view name;
  double LatencyBudget::*milliseconds;
};
inline constexpr std::array<LatencyStage, 8> kLatencyStages{
    LatencyStage{"tracker", &LatencyBudget::tracker},
    LatencyStage{"hand_off", &LatencyBudget::hand_off},
    LatencyStage{"wait", &LatencyBudget::wait},
    LatencyStage{"draw", &LatencyBudget::draw},
    LatencyStage{"gpu_draw", &LatencyBudget::gpu_draw},
    LatencyStage{"compensate", &LatencyBudget::compensate},
    LatencyStage{"present", &LatencyBudget::present},
    LatencyStage{"display", &LatencyBudget::display}};

/// All that veneerd tells of itself.
struct ServiceStatus {
  State state = State::kStarting;
  std::vector<Fault> faults;  ///< oldest first
  std::string material;       ///< file, and its model
  std::string profile;        ///< folder
  std::string scene;
  std::string tracker;  ///< driver, device and how it is doing
  std::string output;
  std::string renderer;
  std::string projector;        ///< what its control said last; empty without one
  std::uint64_t frames = 0;     ///< that went out since the start, dark ones included
  std::uint64_t dropped = 0;    ///< refreshes for which no frame was ready
  std::uint64_t late = 0;       ///< frames that took longer than a period to make
  std::uint64_t recovered = 0;  ///< faults that were overcome
  double frame_rate_hz = 0;     ///< of the last second
  double frame_ms_median = 0;   ///< of the last second
  double frame_ms_p95 = 0;
  double gpu_ms_median = 0;
  LatencyBudget latency_ms;
  /// Of what the picture is made now: "full", or what was taken off to hold the frame rate.
  std::string quality = "full";
  int quality_rung = 0;          ///< 0: "full"
  double luminance_ceiling = 0;  ///< cd/m^2; 0: none
};

}  // namespace veneer::service
