// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/injections.h"

#include <chrono>

namespace veneer::soak {
namespace {

using service::FaultKind;
constexpr auto kNothing = std::nullopt;

constexpr std::array<InjectionKind, kInjectionCount> kKinds{{
    {Injection::kTrackerGone, "tracker gone", Group::kTracker, FaultKind::kTracker, 0.2, 4, 3},
    {Injection::kTrackerSilent, "tracker silent", Group::kTracker, FaultKind::kTracker, 0.2, 4, 3},
    {Injection::kTrackerNan, "tracker NaN", Group::kTracker, FaultKind::kTracker, 0.1, 3, 2},
    {Injection::kTrackerFuture,
     "tracker stamps ahead",
     Group::kTracker,
     FaultKind::kTracker,
     0.1,
     3,
     2},
    {Injection::kTrackerPast,
     "tracker stamps behind",
     Group::kTracker,
     FaultKind::kTracker,
     0.1,
     3,
     2},
    {Injection::kTrackerTeleport,
     "tracker teleports",
     Group::kTracker,
     FaultKind::kTracker,
     0.1,
     2,
     2},
    {Injection::kTrackerFlood, "tracker floods", Group::kTracker, FaultKind::kTracker, 0.1, 1, 2},
    {Injection::kOutputUnavailable,
     "output unavailable",
     Group::kOutput,
     FaultKind::kOutput,
     0.1,
     4,
     3},
    {Injection::kOutputIo, "output error", Group::kOutput, FaultKind::kOutput, 0.1, 1, 3},
    {Injection::kOutputRefusesToOpen,
     "output refuses to open",
     Group::kOutput,
     FaultKind::kOutput,
     0.5,
     4,
     2},
    {Injection::kOutputSlow, "output slow", Group::kOutput, FaultKind::kLate, 0.1, 1, 1},
    {Injection::kOutputLies,
     "output's wrong times",
     Group::kOutput,
     kNothing,
     0.1,
     3,
     2,
     When::kRealTime},
    {Injection::kGpuLost, "GPU lost", Group::kGpu, FaultKind::kGpu, 0.05, 0.3, 2},
    {Injection::kGpuLostInAFrame,
     "GPU lost in a frame",
     Group::kGpu,
     FaultKind::kGpu,
     0.05,
     0.3,
     2},
    {Injection::kGpuRefusesToOpen, "GPU refuses to open", Group::kGpu, FaultKind::kGpu, 0.5, 4, 2},
    {Injection::kGpuSlow, "GPU slow", Group::kGpu, FaultKind::kLate, 0.1, 1, 1},
    {Injection::kProjectorSilent,
     "projector silent",
     Group::kProjector,
     FaultKind::kProjector,
     2,
     8,
     2,
     When::kRealTime},
    {Injection::kProjectorChanged,
     "projector changed",
     Group::kProjector,
     FaultKind::kProjectorState,
     2,
     8,
     2,
     When::kRealTime},
    {Injection::kProjectorSlow,
     "projector slow",
     Group::kProjector,
     FaultKind::kProjector,
     2,
     5,
     1,
     When::kRealTime},
    {Injection::kMaterialCut, "material cut", Group::kFiles, FaultKind::kMaterial, 0.1, 1, 1},
    {Injection::kMaterialGarbage,
     "material garbage",
     Group::kFiles,
     FaultKind::kMaterial,
     0.1,
     1,
     1},
    {Injection::kMaterialGone, "material gone", Group::kFiles, FaultKind::kMaterial, 0.1, 1, 1},
    {Injection::kMaterialOther, "another material", Group::kFiles, kNothing, 0.1, 1, 1},
    {Injection::kProfileDamaged, "profile damaged", Group::kFiles, FaultKind::kProfile, 0.1, 1, 1},
    {Injection::kProfileGone, "profile gone", Group::kFiles, FaultKind::kProfile, 0.1, 1, 1},
    {Injection::kProfileOther, "another profile", Group::kFiles, kNothing, 0.1, 1, 1},
    {Injection::kSceneWrong, "scene wrong", Group::kFiles, FaultKind::kScene, 0.1, 1, 1},
    {Injection::kSceneGone, "scene gone", Group::kFiles, FaultKind::kScene, 0.1, 1, 1},
    {Injection::kConfigurationWrong,
     "configuration wrong",
     Group::kFiles,
     FaultKind::kConfiguration,
     0.1,
     1,
     2},
    {Injection::kDiskFull, "disk full", Group::kDisk, FaultKind::kDisk, 0.1, 1, 2},
    {Injection::kDiskGone, "state folder gone", Group::kDisk, FaultKind::kDisk, 0.1, 1, 2},
    {Injection::kReloadStorm, "storm of reloads", Group::kCalls, kNothing, 0.1, 0.3, 1},
    {Injection::kMaterialStorm, "storm of materials", Group::kCalls, kNothing, 0.1, 0.3, 1},
    {Injection::kLightStorm, "storm of lights", Group::kCalls, kNothing, 0.1, 1, 2},
    {Injection::kBlankStorm, "storm of blanks", Group::kCalls, kNothing, 0.1, 1, 2},
    {Injection::kConcurrentCalls, "calls at once", Group::kCalls, kNothing, 0.1, 0.5, 1},
    {Injection::kMemoryShort, "memory short", Group::kMachine, FaultKind::kMemory, 3, 6, 1},
    {Injection::kClockJump,
     "clock jumps seconds",
     Group::kMachine,
     FaultKind::kTracker,
     0.1,
     0.1,
     1,
     When::kVirtualTime},
    {Injection::kSuspended,
     "clock jumps hours",
     Group::kMachine,
     FaultKind::kTracker,
     0.1,
     0.1,
     0.3,
     When::kVirtualTime},
    {Injection::kStopped,
     "stopped for a second",
     Group::kMachine,
     FaultKind::kTracker,
     0.1,
     0.1,
     1,
     When::kRealTime},
}};

}  // namespace

std::span<const InjectionKind> injection_kinds() { return kKinds; }

const InjectionKind& kind_of(Injection injection) {
  return kKinds[static_cast<std::size_t>(injection)];
}

Duration recovery_limit(const InjectionKind& kind) {
  return kind.fault ? service::recovery_time_of(*kind.fault) : Duration(std::chrono::seconds(1));
}

std::optional<Duration> named_after(const InjectionKind& kind) {
  using namespace std::chrono_literals;
  switch (kind.injection) {
    // A second without a pose, and half of one until a frame has seen it.
    case Injection::kTrackerSilent:
    case Injection::kTrackerNan:
    case Injection::kTrackerFuture:
    case Injection::kTrackerPast:
      return 1500ms;
    // Some frames, on a busy machine.
    case Injection::kTrackerGone:
    case Injection::kOutputUnavailable:
    case Injection::kOutputIo:
    case Injection::kOutputRefusesToOpen:
    case Injection::kGpuRefusesToOpen:
      return 500ms;
    case Injection::kGpuLost:
    case Injection::kGpuLostInAFrame:
      return 200ms;
    // Looked at every two seconds.
    case Injection::kMemoryShort:
      return 3s;
    // Named by the call that finds it.
    case Injection::kMaterialCut:
    case Injection::kMaterialGarbage:
    case Injection::kMaterialGone:
    case Injection::kProfileDamaged:
    case Injection::kProfileGone:
    case Injection::kSceneWrong:
    case Injection::kSceneGone:
    case Injection::kConfigurationWrong:
    case Injection::kDiskFull:
    case Injection::kDiskGone:
    case Injection::kClockJump:
    case Injection::kSuspended:
      return Duration{};
    default:
      return {};
  }
}

}  // namespace veneer::soak
