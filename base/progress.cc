// SPDX-License-Identifier: Apache-2.0
#include "base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <mutex>

namespace veneer {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

/// Writes to standard error; how often and in which form depends on whether somebody watches.
class StderrProgress final : public Progress {
 public:
  explicit StderrProgress(bool terminal)
      : terminal_(terminal),
        interval_(terminal ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000)) {}
  ~StderrProgress() override {
    const std::scoped_lock lock(mutex_);
    abandon();
  }

  void start(std::string_view label, std::int64_t total) override {
    const std::scoped_lock lock(mutex_);
    abandon();
    label_ = label;
    total_ = std::max<std::int64_t>(total, 1);
    done_ = 0;
    begun_ = std::chrono::steady_clock::now();
    shown_ = begun_;
    running_ = true;
    if (terminal_) print_bar(begun_);
  }

  void advance(std::int64_t steps) override {
    done_ += steps;
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock || !running_) return;  // somebody else is just printing
    const SteadyTime now = std::chrono::steady_clock::now();
    if (now - shown_ < interval_) return;
    shown_ = now;
    if (terminal_) {
      print_bar(now);
    } else {
      fmt::print(stderr, "{}: {:.0f} %\n", label_, percent());
    }
  }

  void finish(std::string_view remark) override {
    const std::scoped_lock lock(mutex_);
    if (!running_) return;
    running_ = false;
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count();
    fmt::print(stderr,
               "{}{}: done in {:.1f} s{}{}\n",
               terminal_ ? "\r\033[K" : "",
               label_,
               seconds,
               remark.empty() ? "" : ", ",
               remark);
  }

 private:
  /// Ends the line of a stage that nobody finished: it may have failed, so nothing is claimed.
  void abandon() {
    if (running_ && terminal_) fmt::print(stderr, "\n");
    running_ = false;
  }

  [[nodiscard]] double percent() const {
    return std::min(100.0, 100.0 * static_cast<double>(done_) / static_cast<double>(total_));
  }

  void print_bar(SteadyTime now) const {
    constexpr int kWidth = 30;
    const int filled = static_cast<int>(percent() / 100 * kWidth);
    const double elapsed = std::chrono::duration<double>(now - begun_).count();
    const double left = percent() > 0 ? elapsed * (100 / percent() - 1) : 0;
    fmt::print(stderr,
               "\r\033[K{} [{:#<{}}{:.<{}}] {:3.0f} %, {:.0f} s left",
               label_,
               "",
               filled,
               "",
               kWidth - filled,
               percent(),
               left);
    std::fflush(stderr);
  }

  const bool terminal_;
  const std::chrono::milliseconds interval_;
  std::mutex mutex_;  // guards all below but done_
  std::string label_;
  std::int64_t total_ = 1;
  std::atomic<std::int64_t> done_{0};
  SteadyTime begun_;
  SteadyTime shown_;
  bool running_ = false;
};

}  // namespace

std::unique_ptr<Progress> make_progress() {
  return std::make_unique<StderrProgress>(::isatty(STDERR_FILENO) == 1);
}

}  // namespace veneer
