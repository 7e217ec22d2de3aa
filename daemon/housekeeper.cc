// SPDX-License-Identifier: Apache-2.0
#include "daemon/housekeeper.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <optional>
#include <utility>

#include "base/files.h"
#include "service/journal/journal.h"

namespace veneer::daemon {

using namespace std::chrono_literals;
using service::FaultKind;

namespace {

constexpr Duration kLateInterval = 500ms;
constexpr Duration kLateSpan = 3s;
constexpr double kLateBegins = 0.5;  // most frames
constexpr double kLateEnds = 0.25;
constexpr Duration kSlowInterval = 2s;
// The kernel's mean falls by a factor e in ten seconds: from all to kPressureEnds in 23 s.
constexpr double kPressureBegins = 0.2;
constexpr double kPressureEnds = 0.1;

}  // namespace

Housekeeper::Housekeeper(Clock& clock,
                         ClockKind kind,
                         Faults& faults,
                         const FigureBoard& board,
                         std::function<Result<double>()> pressure)
    : clock_(clock), kind_(kind), faults_(faults), board_(board), pressure_(std::move(pressure)) {}

void Housekeeper::look() {
  const Time now = clock_.now();
  if (now >= late_due_) {
    late_due_ = now + kLateInterval;
    // A virtual frame takes no time.
    if (kind_ == ClockKind::kMonotonic) watch_lateness(now);
  }
  if (now >= slow_due_) {
    slow_due_ = now + kSlowInterval;
    watch_memory(now);
    try_disk(now);
  }
  tell();
}

void Housekeeper::tell() {
  if (const Duration slept = board_.slept() - slept_; slept > Duration::zero()) {
    slept_ += slept;
    spdlog::info("the machine slept for {:.1f} s", to_seconds(slept));
  }
  for (const Faults::Change& change : faults_.take_changes()) {
    if (change.fault) {
      service::log_fault({change.fault->kind, change.fault->since, change.text}, change.begun);
    } else {
      service::log_state(change.state, change.text);
    }
  }
}

void Housekeeper::watch_lateness(Time now) {
  const std::optional<double> part = board_.late_part(now, kLateSpan);
  if (!part) return;
  if (*part > kLateBegins && !faults_.has(FaultKind::kLate)) {
    faults_.begin(
        FaultKind::kLate,
        now,
        fmt::format("{:.0f} % of the frames of the last {} s came late or not at all; "
                    "choose a smaller picture, a lower rate or a simpler material, or let "
                    "the picture give way: [quality] mode = \"deadline\"",
                    100 * *part,
                    kLateSpan / 1s));
  } else if (*part < kLateEnds) {
    faults_.end(FaultKind::kLate, now);
  }
}

void Housekeeper::watch_memory(Time now) {
  if (!pressure_) return;
  const Result<double> pressure = pressure_();
  if (!pressure) {
    spdlog::info("{}", pressure.error().what);
    pressure_ = nullptr;
    return;
  }
  if (*pressure >= kPressureBegins && !faults_.has(FaultKind::kMemory)) {
    faults_.begin(FaultKind::kMemory,
                  now,
                  fmt::format("programs of this machine waited for memory {:.0f} % of the last ten "
                              "seconds; end what is not needed",
                              100 * *pressure));
  } else if (*pressure < kPressureEnds) {
    faults_.end(FaultKind::kMemory, now);
  }
}

void Housekeeper::disk_failed(const std::filesystem::path& file, const Error& error) {
  {
    const std::scoped_lock lock(disk_mutex_);
    unwritten_[file] = error.what;
  }
  faults_.begin(
      FaultKind::kDisk, clock_.now(), fmt::format("{}; frames go on without it", error.what));
}

void Housekeeper::disk_works(const std::filesystem::path& file) {
  const std::scoped_lock lock(disk_mutex_);
  if (unwritten_.erase(file) > 0 && unwritten_.empty()) faults_.end(FaultKind::kDisk, clock_.now());
}

// Of a file beside those that were refused.
void Housekeeper::try_disk(Time now) {
  const std::scoped_lock lock(disk_mutex_);
  if (unwritten_.empty()) return;
  for (auto entry = unwritten_.begin(); entry != unwritten_.end();) {
    std::filesystem::path probe = entry->first;
    probe += fmt::format(".probe-{}", ::getpid());
    const bool works = write_text(probe, "this can be deleted\n").has_value();
    std::error_code ignored;  // it may not be there
    std::filesystem::remove(probe, ignored);
    entry = works ? unwritten_.erase(entry) : std::next(entry);
  }
  if (unwritten_.empty()) faults_.end(FaultKind::kDisk, now);
}

}  // namespace veneer::daemon
