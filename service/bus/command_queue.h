// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_handle.h"
#include "service/bus/command.h"

namespace veneer::service {

/// Has commands done one after the other on a thread of its own, since each may take seconds and
/// the bus is to be answered meanwhile. Blank passes them all, on a second thread, and is never one
/// too many: the dark is asked for when it is urgent. Of several that wait the last is done, and
/// all are answered with what became of it. All but the destructor may be called on any thread.
class CommandQueue {
 public:
  struct Done {
    std::uint64_t id = 0;
    Result<std::string> result;
  };

  /// @param control  borrowed; must outlive the queue.
  explicit CommandQueue(ServiceControl& control);
  /// Waits for the commands that are being done; those that wait are forgotten.
  ~CommandQueue();
  CommandQueue(const CommandQueue&) = delete;
  CommandQueue& operator=(const CommandQueue&) = delete;

  /// @param id  given back with the result.
  /// Errors: those of check(), kTimeout (too many wait).
  [[nodiscard]] Status submit(std::uint64_t id, Command command);
  /// What was done since the last call, in the order in which it was.
  [[nodiscard]] std::vector<Done> take_done();
  /// Becomes readable when something was done; take_done() quiets it.
  [[nodiscard]] int done_fd() const { return done_fd_.value(); }

 private:
  struct Job {
    std::uint64_t id;
    Command command;
  };
  struct WaitingBlank {
    std::uint64_t id;
    Blank command;
  };
  void run();
  void run_blanks();
  /// With mutex_ locked.
  void tell(std::uint64_t id, Result<std::string> result);

  ServiceControl& control_;
  UniqueFd done_fd_;
  std::mutex mutex_;
  std::condition_variable submitted_;
  std::condition_variable blank_submitted_;
  bool stop_ = false;
  std::deque<Job> jobs_;
  std::vector<WaitingBlank> blanks_;
  std::vector<Done> done_;
  std::thread thread_;
  std::thread blanking_thread_;
};

}  // namespace veneer::service
