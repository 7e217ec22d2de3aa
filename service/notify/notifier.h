// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/clock.h"
#include "service/control.h"

namespace veneer::service {

struct NotifyOptions {
  /// How often it is looked whether anything is to be said.
  Duration poll = std::chrono::milliseconds(100);
  /// STATUS= is written no more often than this.
  Duration status = std::chrono::seconds(1);
  /// While no frame was shown yet, the service manager is asked for so much more time, again and
  /// again until half of it is left...
  Duration start_extension = std::chrono::seconds(20);
  /// ...but not after this: whoever has not started by then does not start.
  Duration longest_start = std::chrono::minutes(5);
};

/// Tells systemd how the service is: READY=1 with the first frame, STATUS=, RELOADING=1 and READY=1
/// around a reload, STOPPING=1, and WATCHDOG=1 as long as frames go out, or a display refuses them
/// (sd_notify(3)). Says nothing where nobody listens: without NOTIFY_SOCKET start() gives nothing
/// to hold.
class Notifier {
 public:
  /// @param control  borrowed; must outlive the notifier.
  /// Null where nobody listens.
  [[nodiscard]] static std::unique_ptr<Notifier> start(const ServiceControl& control,
                                                       const NotifyOptions& options = {});
  /// Says STOPPING=1, if it was not said.
  ~Notifier();
  Notifier(const Notifier&) = delete;
  Notifier& operator=(const Notifier&) = delete;

  /// Around a reload; any thread. Reloads before the first frame are part of the start, and are not
  /// told.
  void reloading();
  void reloaded();
  /// STOPPING=1, once; any thread. Nothing is said after it.
  void stopping();

 private:
  Notifier(const ServiceControl& control, const NotifyOptions& options);
  void run();
  void look(Time now);
  void look_at_start(Time now);
  void look_at_status(Time now);
  void look_at_turns(Time now);
  void say_stopping();

  const ServiceControl& control_;
  const NotifyOptions options_;
  std::optional<Duration> ping_period_;  // none: nobody watches
  Time begun_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  bool ready_ = false;
  bool stopping_ = false;
  int reloads_ = 0;  // that are going on
  Time extended_until_;
  Time status_at_;
  std::string said_;
  Time looked_at_turns_;
  std::uint64_t turns_ = 0;

  std::thread thread_;
};

/// "degraded: tracker, disk; 59.9 frames a second": one line.
[[nodiscard]] std::string status_line(const ServiceStatus& status);

}  // namespace veneer::service
