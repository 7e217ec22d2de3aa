// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "base/clock.h"
#include "service/status.h"

namespace veneer::soak {

/// What is done to a running daemon.
enum class Injection {
  // The tracker.
  kTrackerGone,
  kTrackerSilent,
  kTrackerNan,
  kTrackerFuture,
  kTrackerPast,
  kTrackerTeleport,
  kTrackerFlood,
  // The output.
  kOutputUnavailable,
  kOutputIo,
  kOutputRefusesToOpen,
  kOutputSlow,
  kOutputLies,
  // The renderer.
  kGpuLost,
  kGpuLostInAFrame,
  kGpuRefusesToOpen,
  kGpuSlow,
  // The projector's own interface.
  kProjectorSilent,
  kProjectorChanged,
  kProjectorSlow,
  // Files.
  kMaterialCut,
  kMaterialGarbage,
  kMaterialGone,
  kMaterialOther,
  kProfileDamaged,
  kProfileGone,
  kProfileOther,
  kSceneWrong,
  kSceneGone,
  kConfigurationWrong,
  kDiskFull,
  kDiskGone,
  // Calls.
  kReloadStorm,
  kMaterialStorm,
  kLightStorm,
  kBlankStorm,
  kConcurrentCalls,
  // The machine.
  kMemoryShort,
  kClockJump,
  kSuspended,
  kStopped,
};
inline constexpr std::size_t kInjectionCount = static_cast<std::size_t>(Injection::kStopped) + 1;

/// Of what is in one group, one thing at a time is wrong.
enum class Group { kTracker, kOutput, kGpu, kProjector, kFiles, kDisk, kCalls, kMachine };
inline constexpr std::size_t kGroupCount = static_cast<std::size_t>(Group::kMachine) + 1;

/// On which clock it can be done.
enum class When { kAlways, kRealTime, kVirtualTime };

struct InjectionKind {
  Injection injection;
  std::string_view name;
  Group group;
  /// What the daemon may list because of it, and whose recovery time holds; none for what it should
  /// take without a word.
  std::optional<service::FaultKind> fault;
  double shortest_s;  ///< how long the cause lasts
  double longest_s;
  double weight;  ///< how often it is chosen, relative to the others
  When when = When::kAlways;
};

/// All of them, in the order of the enumeration.
[[nodiscard]] std::span<const InjectionKind> injection_kinds();
[[nodiscard]] const InjectionKind& kind_of(Injection injection);
/// After its cause has gone. Where nothing is to be listed: the time in which frames are shown
/// again.
[[nodiscard]] Duration recovery_limit(const InjectionKind& kind);
/// How long it has to last for the daemon to name it; none for what it may take without a word:
/// poses that are dropped one by one, frames that are late for a while, a projector, which is asked
/// ever more seldom after a silence.
[[nodiscard]] std::optional<Duration> named_after(const InjectionKind& kind);

/// What is wrong at the moment. Set by whoever injects, read by the devices, in any thread.
class Switches {
 public:
  void set(Injection injection, bool on) { on_[index(injection)] = on; }
  [[nodiscard]] bool is_on(Injection injection) const { return on_[index(injection)]; }
  /// Whether it is on; counts that it was met.
  [[nodiscard]] bool met(Injection injection) {
    if (!on_[index(injection)]) return false;
    ++met_[index(injection)];
    return true;
  }
  void count(Injection injection) { ++met_[index(injection)]; }
  [[nodiscard]] std::uint64_t times_met(Injection injection) const {
    return met_[index(injection)];
  }

 private:
  static std::size_t index(Injection injection) { return static_cast<std::size_t>(injection); }
  std::array<std::atomic<bool>, kInjectionCount> on_{};
  std::array<std::atomic<std::uint64_t>, kInjectionCount> met_{};
};

}  // namespace veneer::soak
