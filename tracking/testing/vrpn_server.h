// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "base/unique_handle.h"
#include "tracking/testing/vrpn_writer.h"

namespace veneer::tracking::vrpn {

/// A small VRPN server with one tracker, "Tracker0", for tests: it speaks the protocol from the
/// document and reads what the client says with code of its own. Serves one client at a time on a
/// thread, until it is destroyed: then the connection is closed.
class Server {
 public:
  struct Options {
    int port = 0;  ///< 0: any
    std::string version = "07.35";
    bool sends_poses = true;  ///< to begin with
  };
  explicit Server(const Options& options);

  [[nodiscard]] int port() const { return port_; }
  void send_poses(bool on) { sends_poses_ = on; }
  /// Sets its wall clock, which stamps the poses.
  void step_clock(std::chrono::seconds step) { clock_step_s_ += step.count(); }
  /// Asks the client whether it is there.
  void ping() { ping_wanted_ = true; }
  /// What clients have said so far.
  [[nodiscard]] int connections() const { return connections_; }
  [[nodiscard]] int pings() const { return pings_; }
  [[nodiscard]] int pongs() const { return pongs_; }
  /// What was wrong with it; empty where nothing was.
  [[nodiscard]] std::string complaint() const;

 private:
  /// What a client has agreed on.
  struct Client {
    Bytes pending;
    bool greeted = false;
    std::int32_t tracker = -1;
    std::int32_t ping = -1;
    std::int32_t pong = -1;
  };
  void run(const std::stop_token& stop);
  void serve(const UniqueFd& client, const std::stop_token& stop);
  /// Whether the client is still there.
  bool hear(const UniqueFd& fd, Client& client);
  /// One message; nothing but the greeting comes without a header.
  void take(Client& client, const UniqueFd& fd, const Bytes& message);
  void send(const UniqueFd& fd, const Bytes& bytes);
  void complain(const std::string& text);

  Options options_;
  UniqueFd listener_;
  int port_ = 0;
  std::atomic<bool> sends_poses_;
  std::atomic<bool> ping_wanted_ = false;
  std::atomic<std::int64_t> clock_step_s_ = 0;
  std::atomic<int> connections_ = 0;
  std::atomic<int> pings_ = 0;
  std::atomic<int> pongs_ = 0;
  mutable std::mutex mutex_;
  std::string complaint_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace veneer::tracking::vrpn
