// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "base/unique_handle.h"
#include "projector/control.h"
#include "projector/control/pjlink/name_lookup.h"
#include "projector/control/pjlink/pjlink_connection.h"
#include "projector/control/pjlink/pjlink_protocol.h"

namespace veneer::projector {

/// Keys of the [control] table.
struct PjlinkOptions {
  std::string host;
  int port = 4352;
  std::string password;
  Duration time_limit = std::chrono::seconds(5);  ///< for a connection and for each answer
  /// Devices mind being asked more often: read_state() repeats its last answer until then.
  Duration shortest_period = std::chrono::seconds(2);
  /// Projectors hang up on who says nothing for 30 s; we are gone before.
  Duration longest_idle = std::chrono::seconds(25);
  /// How a host that is a name is looked up; bounded by the time limit, whatever it does.
  pjlink::Resolve resolve = pjlink::resolve_by_system;
  /// Keys: host, port, password or password_file (its first line), time_limit_s.
  /// Errors: kInvalidOption, kNotFound (the password's file).
  [[nodiscard]] static Result<PjlinkOptions> read(TomlReader& config);
  [[nodiscard]] Status check() const;
};

/// A projector that speaks PJLink, class 1 or 2.
///
/// Connects when it is first asked, and again by itself: a connection that was left idle and is
/// found dead is made anew once, silently. After an error the next call begins afresh.
class Pjlink final : public ProjectorControl {
 public:
  /// Connects to nothing yet. Errors: kInvalidOption, kNotFound.
  [[nodiscard]] static Result<std::unique_ptr<Pjlink>> open(TomlReader& config, Clock& clock);
  /// @param clock  borrowed; must outlive it. Of the device's own periods; waits for the network
  /// are
  ///               on CLOCK_MONOTONIC.
  Pjlink(PjlinkOptions options, Clock& clock);

  [[nodiscard]] std::string description() const override;
  void interrupt() override;
  [[nodiscard]] Result<ProjectorState> read_state() override;
  /// One that goes on without answering, as from standby, is asked for its power for a while.
  [[nodiscard]] Status power(bool on) override;
  [[nodiscard]] Status mute(bool on) override;
  /// Class 2 alone.
  [[nodiscard]] Status freeze(bool on) override;
  [[nodiscard]] Status select_input(const std::string& input) override;

 private:
  [[nodiscard]] Status connect();
  /// One request on the present connection.
  [[nodiscard]] Result<pjlink::Reply> exchange(const pjlink::Request& request);
  /// The same, on a connection that is made where there is none, and made again if it went stale.
  [[nodiscard]] Result<pjlink::Reply> ask(const pjlink::Request& request);
  /// What is not told is empty; that the projector has failed (ERR4) goes into `state`.
  [[nodiscard]] Result<std::optional<std::string>> ask_if_known(const pjlink::Request& request,
                                                                ProjectorState& state);
  /// Its reply: "OK" or a refusal.
  [[nodiscard]] Result<pjlink::Reply> try_command(const pjlink::Request& request);
  [[nodiscard]] Status command(const pjlink::Request& request);
  [[nodiscard]] Result<int> protocol_class();
  [[nodiscard]] Result<ProjectorState> ask_for_everything();
  [[nodiscard]] Status went_on_anyway(const Error& silence);

  PjlinkOptions options_;
  Clock& clock_;
  UniqueFd stop_;  // an eventfd; before connection_, which borrows it
  std::optional<pjlink::Connection> connection_;
  std::string digest_;  // before the first request of the connection
  bool fresh_ = true;   // nothing was answered on the connection so far
  Time last_used_;
  std::optional<int> class_;
  std::optional<ProjectorState> state_;
  Time state_time_;
};

}  // namespace veneer::projector
