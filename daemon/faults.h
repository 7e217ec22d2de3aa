// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "service/status.h"

namespace veneer::daemon {

/// The state machine: which faults there are, and what follows from them. Any thread may call; a
/// call holds a lock for the time of copying a text. What changed is kept until somebody who may
/// wait for the log asks for it.
///
/// The state is kStopping once that was said; else the worst of kStarting before the first frame
/// (kRunning after it), of kBlank where somebody asked for the dark, and of service::effect_of each
/// fault. Before the first frame a fault that leaves a picture does not change kStarting.
class Faults {
 public:
  /// It is wrong, and why. A fault that is there already keeps its beginning and takes the text.
  /// Returns whether it is new.
  bool begin(service::FaultKind kind, Time now, std::string_view text);
  /// It is over. Returns whether there was one.
  bool end(service::FaultKind kind, Time now);
  void first_frame();
  void ask_for_dark(bool dark);
  void stopping();

  [[nodiscard]] service::State state() const;
  /// Takes no lock, nor does end() of a fault that is not there.
  [[nodiscard]] bool has(service::FaultKind kind) const;
  [[nodiscard]] std::vector<service::Fault> list() const;  ///< oldest first
  /// Faults that were overcome.
  [[nodiscard]] std::uint64_t recovered() const;

  /// A line of the log, once for each change: of a fault, or else of the state.
  struct Change {
    std::optional<service::Fault> fault;
    bool begun = false;  ///< the fault; else it is over
    service::State state = service::State::kStarting;
    std::string text;
  };
  /// The changes since the last call, oldest first; at most kRememberedChanges.
  [[nodiscard]] std::vector<Change> take_changes();
  static constexpr std::size_t kRememberedChanges = 100;

 private:
  [[nodiscard]] service::State state_locked() const;
  void note(Change change);
  void note_state(service::State before);

  mutable std::mutex mutex_;
  std::array<std::optional<service::Fault>, service::kFaultKindCount> faults_;
  std::vector<Change> changes_;
  std::atomic<std::uint32_t> present_{0};  // a bit for each kind
  std::uint64_t recovered_ = 0;
  bool shown_ = false;
  bool dark_asked_ = false;
  bool stopping_ = false;
};

}  // namespace veneer::daemon
