// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_handle.h"

namespace veneer::projector::pjlink {

/// A PJLink projector on the loopback, for tests: written with bare sockets, apart from what it
/// tests. It serves one connection after another and keeps every byte that it gets.
class FakeProjector {
 public:
  struct Behaviour {
    std::string greeting = "PJLINK 0\r";
    /// Replies by request, both whole lines; "" hangs up, "..." says nothing. A request that is not
    /// there gets ERR1.
    std::map<std::string, std::string> replies;
    /// Before the greeting and before every reply.
    std::chrono::milliseconds delay{0};
    /// Between the bytes of what it sends.
    std::chrono::milliseconds byte_delay{0};
    /// Hangs up after so many replies on a connection; 0: never.
    int replies_a_connection = 0;
  };
  /// Of class 2, on, and nothing wrong with it.
  [[nodiscard]] static Behaviour well();

  /// @param port  0: any that is free.
  explicit FakeProjector(Behaviour behaviour, int port = 0);
  ~FakeProjector();
  FakeProjector(const FakeProjector&) = delete;
  FakeProjector& operator=(const FakeProjector&) = delete;

  [[nodiscard]] int port() const { return port_; }
  void reply(const std::string& request, const std::string& reply);
  void greet(const std::string& greeting);
  /// What came on each connection so far, byte for byte.
  [[nodiscard]] std::vector<std::string> conversations() const;
  /// Waits until the client's last connection is over at this end too.
  void wait_for_end() const;

 private:
  void serve();
  void converse(int fd);
  [[nodiscard]] bool send_slowly(int fd, const std::string& text);

  mutable std::mutex mutex_;
  Behaviour behaviour_;
  std::vector<std::string> conversations_;
  int port_ = 0;
  UniqueFd listener_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> busy_{false};
  std::thread thread_;
};

}  // namespace veneer::projector::pjlink
