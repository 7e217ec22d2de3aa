// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <thread>

#include "daemon/daemon.h"
#include "daemon/testing/daemon_fixture.h"

namespace veneer::daemon::testing {

/// Waits until `done`; false if that takes half a minute.
inline bool wait_until(const std::function<bool()>& done) {
  using namespace std::chrono_literals;
  for (int i = 0; i < 6000 && !done(); ++i) std::this_thread::sleep_for(5ms);
  return done();
}

/// A daemon with all its threads, in real time.
class RealTimeFixture : public DaemonFixture {
 protected:
  void start() { start_with(devices()); }
  void start_with(Devices devices) {
    auto daemon = Daemon::create(at("veneer.toml"), {"frame_rate_hz=200"}, std::move(devices));
    ASSERT_TRUE(daemon) << daemon.error().what;
    daemon_ = *std::move(daemon);
    ran_ = std::async(std::launch::async, [this] {
      SilentProgress silent;
      return daemon_->run(stop_, silent);
    });
    ASSERT_TRUE(wait_until([&] { return daemon_->frames() > 10; }));
  }
  /// Where a test gave up before its end(): else its thread would be waited for for ever.
  void TearDown() override {
    stop_ = true;
    if (ran_.valid()) ran_.wait();
  }
  void end() {
    stop_ = true;
    const Result<Summary> summary = ran_.get();
    ASSERT_TRUE(summary) << summary.error().what;
    EXPECT_EQ(hand_.alive, 0);
  }

  std::atomic<bool> stop_{false};
  std::unique_ptr<Daemon> daemon_;
  std::future<Result<Summary>> ran_;
};

}  // namespace veneer::daemon::testing
