// SPDX-License-Identifier: Apache-2.0
#include "service/notify/notifier.h"

#include <systemd/sd-daemon.h>

#include <algorithm>
#include <cstdlib>

namespace veneer::service {
namespace {

/// Failures are not reported: there is nobody else to tell, and systemd finds out by itself.
void say(const std::string& what) { ::sd_notify(0, what.c_str()); }

/// A quarter of the time after which systemd takes us for dead: two looks may find no new frame
/// without harm.
std::optional<Duration> ping_period() {
  std::uint64_t usec = 0;
  if (::sd_watchdog_enabled(0, &usec) <= 0) return {};
  return Duration(std::chrono::microseconds(usec)) / 4;
}

std::int64_t microseconds(Duration d) {
  return std::chrono::ceil<std::chrono::microseconds>(d).count();
}

}  // namespace

std::string status_line(const ServiceStatus& status) {
  std::string line(name_of(status.state));
  for (std::size_t i = 0; i < status.faults.size(); ++i)
    line += fmt::format("{}{}", i == 0 ? ": " : ", ", name_of(status.faults[i].kind));
  if (status.frame_rate_hz > 0)
    line += fmt::format("; {:.0f} frames a second", status.frame_rate_hz);
  return line;
}

std::unique_ptr<Notifier> Notifier::start(const ServiceControl& control,
                                          const NotifyOptions& options) {
  const char* const socket = std::getenv("NOTIFY_SOCKET");
  if (socket == nullptr || *socket == '\0') return nullptr;
  return std::unique_ptr<Notifier>(new Notifier(control, options));
}

Notifier::Notifier(const ServiceControl& control, const NotifyOptions& options)
    : control_(control),
      options_(options),
      ping_period_(ping_period()),
      begun_(SteadyClock().now()),
      extended_until_(begun_),
      looked_at_turns_(begun_) {
  thread_ = std::thread([this] { run(); });
}

Notifier::~Notifier() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
    say_stopping();
  }
  wake_.notify_all();
  thread_.join();
}

void Notifier::reloading() {
  const std::scoped_lock lock(mutex_);
  if (!ready_ || stopping_ || ++reloads_ > 1) return;
  say(fmt::format("RELOADING=1\nMONOTONIC_USEC={}\nSTATUS=reloading",
                  microseconds(SteadyClock().now().time_since_epoch())));
  said_ = "reloading";
}

void Notifier::reloaded() {
  const std::scoped_lock lock(mutex_);
  if (reloads_ == 0 || --reloads_ > 0 || stopping_) return;
  said_ = status_line(control_.status());
  say("READY=1\nSTATUS=" + said_);
}

void Notifier::stopping() {
  const std::scoped_lock lock(mutex_);
  say_stopping();
}

void Notifier::run() {
  std::unique_lock lock(mutex_);
  Duration poll = options_.poll;
  if (ping_period_) poll = std::min(poll, *ping_period_);
  while (!stop_) {
    look(SteadyClock().now());
    wake_.wait_for(lock, poll, [this] { return stop_; });
  }
}

void Notifier::look(Time now) {
  if (stopping_) return;
  look_at_start(now);
  look_at_status(now);
  look_at_turns(now);
}

void Notifier::look_at_start(Time now) {
  if (ready_) return;
  if (control_.frames() > 0) {
    ready_ = true;
    status_at_ = now;
    said_ = status_line(control_.status());
    say("READY=1\nSTATUS=" + said_);
  } else if (now + options_.start_extension / 2 > extended_until_ &&
             now - begun_ < options_.longest_start) {
    extended_until_ = now + options_.start_extension;
    say(fmt::format("EXTEND_TIMEOUT_USEC={}", microseconds(options_.start_extension)));
  }
}

void Notifier::look_at_status(Time now) {
  if (reloads_ > 0 || (now - status_at_ < options_.status && !said_.empty())) return;
  status_at_ = now;
  const ServiceStatus status = control_.status();
  if (status.state == State::kStopping) return say_stopping();
  std::string line = status_line(status);
  if (line == said_) return;
  say("STATUS=" + line);
  said_ = std::move(line);
}

void Notifier::look_at_turns(Time now) {
  if (!ping_period_ || now - looked_at_turns_ < *ping_period_) return;
  looked_at_turns_ = now;
  const std::uint64_t turns = control_.turns();
  if (turns != turns_) say("WATCHDOG=1");
  turns_ = turns;
}

void Notifier::say_stopping() {
  if (stopping_) return;
  stopping_ = true;
  say("STOPPING=1\nSTATUS=stopping");
}

}  // namespace veneer::service
