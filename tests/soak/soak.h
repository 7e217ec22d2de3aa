// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/random.h"
#include "base/result.h"
#include "daemon/daemon.h"
#include "tests/soak/census.h"
#include "tests/soak/display.h"
#include "tests/soak/faulty_devices.h"
#include "tests/soak/injections.h"
#include "tests/soak/machine_load.h"
#include "tests/soak/stage.h"

namespace veneer::soak {

struct SoakOptions {
  bool virtual_time = true;
  double seconds = 600;  ///< of the daemon's time, without the hours that its clock jumps
  double frame_rate_hz = 30;
  double pause_s = 2.0;  ///< mean, from one injection to the next
  double ceiling_nits = 250;
  std::uint64_t seed = 1;
};

/// What became of all injections of a kind.
struct Tally {
  std::uint64_t injected = 0;
  std::uint64_t met = 0;        ///< how often a device failed because of it
  std::uint64_t listed = 0;     ///< injections that the daemon named among its faults
  std::uint64_t lasting = 0;    ///< those that lasted long enough to be named (named_after)
  std::uint64_t recovered = 0;  ///< within its time
  /// Nobody can say: the machine was busy all along, or another thing kept the fault up.
  std::uint64_t untold = 0;
  Duration longest{};  ///< recovery
};

struct SoakResult {
  std::array<Tally, kInjectionCount> tallies{};
  std::uint64_t injected = 0;
  int kinds = 0;
  std::vector<std::string> violations;  ///< the first hundred, in words
  std::uint64_t violation_count = 0;
  Display::Picture picture;
  std::uint64_t draws = 0;
  std::uint64_t renderers = 0;
  double dark_seconds = 0;  ///< nothing was lit, or an old picture stood still
  double real_seconds = 0;
  double daemon_seconds = 0;
  double busy_seconds = 0;  ///< other programs kept the machine busy
  /// At moments that are spread evenly and at which nothing was wrong: the first before any
  /// injection, each other once what was begun is over, so that like is compared with like.
  std::vector<Holdings> holdings;
};
[[nodiscard]] std::string text_of(const SoakResult& result);

/// A daemon that runs while things are done to it.
///
/// On a virtual clock all of it happens in the thread that draws, before each frame; in real time,
/// in a thread of its own.
class Soak {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Soak>> create(const SoakOptions& options);
  /// Errors: those of the daemon before its first frame, or when it gives up.
  [[nodiscard]] Result<SoakResult> run();

 private:
  struct Active {
    const InjectionKind* kind = nullptr;
    Time begun;
    Time until;                 ///< the cause goes
    std::optional<Time> ended;  ///< it has gone
    std::uint64_t frames_at_end = 0;
    bool listed = false;
  };

  Soak(const SoakOptions& options, std::unique_ptr<Stage> stage);
  /// The daemon's time without the jumps that we made.
  [[nodiscard]] Time now() const;
  void tick();
  void begin(const InjectionKind& kind);
  void end(Active& active);
  void storm(Injection injection);
  void break_file(Injection injection);
  void look_for_recovery(Active& active, const service::ServiceStatus& status);
  [[nodiscard]] bool census_due() const;
  void take_census(bool idle);
  void watch_picture(const service::ServiceStatus& status);
  void jump(Duration by);
  void stop_for_a_second();
  void call_at_once();
  void write_when_full();
  void reload(bool must_succeed);
  void violate(const std::string& text);
  [[nodiscard]] const InjectionKind* choose();

  SoakOptions options_;
  std::unique_ptr<Stage> stage_;
  Display display_;
  Switches switches_;
  DrawLaws laws_;
  std::atomic<Clock*> clock_{nullptr};
  std::unique_ptr<daemon::Daemon> daemon_;
  std::atomic<bool> stop_{false};
  Pcg32 random_;
  std::array<std::optional<Active>, kGroupCount> active_;
  SoakResult result_;
  Duration jumped_{};
  std::optional<Time> begin_;
  Time last_tick_;
  Time next_injection_;
  MachineLoad load_;
  std::optional<Time> busy_;        // when the machine last was
  std::optional<Time> idle_since_;  // nothing has been wrong
  double census_every_s_;
  int dark_ticks_ = 0;  // that it should have been dark
  int lost_ticks_ = 0;  // that no pose has come
  int storm_step_ = 0;
};

}  // namespace veneer::soak
