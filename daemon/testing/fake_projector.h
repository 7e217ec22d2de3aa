// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>

#include "projector/control.h"

namespace veneer::daemon::testing {

/// A projector that says what it is told to say.
struct Machine {
  std::mutex mutex;
  projector::ProjectorState state;
  std::atomic<bool> there{true};
  std::atomic<int> opened{0};
  void set(const std::function<void(projector::ProjectorState&)>& edit) {
    const std::scoped_lock lock(mutex);
    edit(state);
  }
};

class FakeControl final : public projector::ProjectorControl {
 public:
  explicit FakeControl(Machine& machine) : machine_(machine) { ++machine_.opened; }
  std::string description() const override { return "a machine"; }
  Result<projector::ProjectorState> read_state() override {
    const std::scoped_lock lock(machine_.mutex);
    return machine_.state;
  }
  Status power(bool) override { return {}; }
  Status mute(bool) override { return {}; }
  Status freeze(bool) override { return {}; }
  Status select_input(const std::string&) override { return {}; }

 private:
  Machine& machine_;
};

}  // namespace veneer::daemon::testing
