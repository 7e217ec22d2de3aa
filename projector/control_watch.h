// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/control.h"

namespace veneer::projector {

struct ControlWatchOptions {
  /// Between two questions after the state. Projectors on the network go astray when they are asked
  /// too often.
  Duration period = std::chrono::seconds(30);
  /// After a failure: the first pause, doubled with every further one up to the longest. A
  /// projector that is being switched on takes a minute or more.
  Duration first_pause = std::chrono::seconds(5);
  Duration longest_pause = std::chrono::seconds(60);

  /// The key `poll_s` of the [control] table, beside those of its driver: 1 to 3600, and 10 at
  /// least for driver = "pjlink". A wrong one is a mistake of the file (TomlReader::finish).
  [[nodiscard]] static ControlWatchOptions read(TomlReader& control_table);
  /// Errors: kInvalidOption (a period or pause that is not above 0).
  [[nodiscard]] Status check() const;
};

/// How a projector is doing, as last seen.
struct ControlReport {
  bool asked = false;      ///< false: no answer and no failure yet, as just after the start
  bool reachable = false;  ///< the last question was answered
  /// A line: the projector and its state, or what went wrong and what to do.
  std::string text;
  /// What is not as it was when the profile was measured, and what would spoil colours now and was
  /// not so then, a sentence each: of the last state that was read, though the projector be lost
  /// since.
  std::vector<std::string> changes;
  std::vector<std::string> warnings;
  std::optional<ProjectorState> state;  ///< the last that was read
  Time read;                            ///< when that was, on CLOCK_MONOTONIC
  int failures = 0;                     ///< in a row, up to now
};

/// Asks once. A failure is in the report too; then it has no state.
[[nodiscard]] ControlReport look_at(ProjectorControl& control, const ControlRecord& kept);

/// Watches a projector on a thread of its own, for as long as it lives: whether it can be reached,
/// and whether it is still as it was when the profile was measured. It is opened for every question
/// and closed after it: many projectors speak with one program at a time, and a person may want to
/// switch it off meanwhile.
class ControlWatch {
 public:
  using Open = std::function<Result<std::unique_ptr<ProjectorControl>>()>;
  /// @param open  called on the watch's thread for every question; what it captures must outlive
  ///              the watch.
  /// @param kept  the profile's record; keys that are not the projector's do no harm. What it does
  ///              not have is no difference.
  ControlWatch(Open open, const ControlRecord& kept, const ControlWatchOptions& options);
  /// Interrupts a question that is under way and waits for its end.
  ~ControlWatch();
  ControlWatch(const ControlWatch&) = delete;
  ControlWatch& operator=(const ControlWatch&) = delete;

  /// Any thread; copies, and never waits for the projector.
  [[nodiscard]] ControlReport report() const;
  /// Another profile is drawn with. Any thread; never waits for the projector. The changes are
  /// those against it from here on.
  void keep(const ControlRecord& kept);

 private:
  void watch();
  [[nodiscard]] Result<ProjectorState> ask(std::string& description);
  void tell(const ProjectorState& state, const std::string& description);
  void tell(const Error& error);
  /// Until the next question.
  [[nodiscard]] Duration pause() const;

  const Open open_;
  const ControlWatchOptions options_;

  mutable std::mutex mutex_;  // never held while the projector is spoken with
  std::condition_variable stopped_;
  bool stopping_ = false;
  ProjectorControl* asked_ = nullptr;  // while a question is under way
  ControlRecord kept_;
  ControlReport report_;
  std::thread thread_;
};

/// A line about a state, for people: "on, input digital1, lamp 1234 h". Shorter than to_record().
[[nodiscard]] std::string summary_of(const ProjectorState& state);

}  // namespace veneer::projector
