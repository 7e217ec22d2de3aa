// SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/result.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;

/// Shares of a stamp's error that go into phase and period: critically damped for kPhaseGain =
/// 2 sqrt(kPeriodGain). Averages over some ten stamps.
constexpr double kPhaseGain = 0.2;
constexpr double kPeriodGain = 0.01;
/// A display's clock is a crystal, and a mode's rate is rounded; nothing is farther off.
constexpr double kPeriodTolerance = 0.02;
/// Errors over this part of a period are no jitter.
constexpr double kStrangeError = 0.25;
constexpr int kBelieveStrange = 3;

constexpr Duration kLeastMargin = 300us;  // the scheduler's own lateness, and the kernel's commit
constexpr Duration kFirstMargin = 1500us;
constexpr double kMostMarginPart = 0.6;  // of a period
constexpr double kMarginGrowth = 1.5;
constexpr double kMarginDecay = 0.998;  // for each frame: to half in 6 s at 60 a second
constexpr double kTimeRank = 0.95;
/// So many frames are believed when they say that slow ones are over.
constexpr std::size_t kRecent = 8;
/// Of a period: what a margin may fill. More would have every second refresh left out for sure, to
/// be safe from missing one now and then.
constexpr double kMostLeadPart = 0.95;
/// After this many refreshes without a frame it is no longer pacing but a start.
constexpr double kPause_periods = 60;

double count(Duration d) { return static_cast<double>(d.count()); }

Duration rounded(double ns) { return Duration{std::llround(ns)}; }

}  // namespace

RefreshClock::RefreshClock(Duration nominal)
    : nominal_ns_(count(nominal)), period_ns_(nominal_ns_) {
  VENEER_CHECK(nominal > Duration::zero());
}

void RefreshClock::start_over() {
  anchor_.reset();
  fraction_ns_ = 0;
  period_ns_ = nominal_ns_;
  strange_ = 0;
}

Duration RefreshClock::period() const { return rounded(period_ns_); }

void RefreshClock::add(Time stamp) {
  if (!anchor_) {
    anchor_ = stamp;
    return;
  }
  const double since_ns = count(stamp - *anchor_) - fraction_ns_;
  const double refreshes = std::round(since_ns / period_ns_);
  if (refreshes < 1) return;  // told before
  const double error_ns = since_ns - refreshes * period_ns_;
  // Over a long pause the period's own error adds up; then the phase is taken as it is.
  if (std::abs(error_ns) > kStrangeError * period_ns_ || refreshes > kPause_periods) {
    if (++strange_ < kBelieveStrange && refreshes <= kPause_periods) return;
    const double period_ns = period_ns_;
    start_over();
    period_ns_ = period_ns;
    anchor_ = stamp;
    return;
  }
  strange_ = 0;
  const double step_ns = fraction_ns_ + refreshes * period_ns_ + kPhaseGain * error_ns;
  const Duration whole = rounded(step_ns);
  anchor_ = *anchor_ + whole;
  fraction_ns_ = step_ns - count(whole);
  period_ns_ = std::clamp(period_ns_ + kPeriodGain * error_ns / refreshes,
                          (1 - kPeriodTolerance) * nominal_ns_,
                          (1 + kPeriodTolerance) * nominal_ns_);
}

Time RefreshClock::next_after(Time when) const {
  if (!anchor_) return when + period();
  const double refreshes = std::floor((count(when - *anchor_) - fraction_ns_) / period_ns_) + 1;
  Time next = *anchor_ + rounded(fraction_ns_ + refreshes * period_ns_);
  if (next <= when) next += period();  // rounding
  return next;
}

Time RefreshClock::nearest(Time when) const {
  if (!anchor_) return when;
  const double refreshes = std::round((count(when - *anchor_) - fraction_ns_) / period_ns_);
  return *anchor_ + rounded(fraction_ns_ + refreshes * period_ns_);
}

Pacer::Pacer(Duration period, bool late) : refreshes_(period), late_(late), margin_(kFirstMargin) {
  margin_ = std::min(margin_, rounded(kMostMarginPart * count(period)));
}

void Pacer::start_over() {
  refreshes_.start_over();
  last_refresh_.reset();
  last_shown_.reset();
  time_count_ = 0;
  planned_ = {};
}

Duration Pacer::lead() const {
  const std::size_t known = std::min(time_count_, kRemembered);
  if (known == 0) return refreshes_.period();  // the first frames take longest
  std::array<Duration, kRemembered> sorted = times_;
  const auto rank = static_cast<std::ptrdiff_t>(kTimeRank * static_cast<double>(known - 1));
  std::nth_element(
      sorted.begin(), sorted.begin() + rank, sorted.begin() + static_cast<std::ptrdiff_t>(known));
  Duration time = sorted[static_cast<std::size_t>(rank)];
  const Duration most = rounded(kMostLeadPart * count(refreshes_.period()));
  // More than a period leaves refreshes out, and dozens of frames take long to forget at that rate:
  // it is believed only while frames of late have needed it.
  if (time > most) {
    Duration longest{};
    for (std::size_t i = 1; i <= std::min(known, kRecent); ++i)
      longest = std::max(longest, times_[(time_count_ - i) % kRemembered]);
    time = std::min(time, longest);
  }
  return time < most ? std::min(time + margin_, most) : time + margin_;
}

Pacer::Plan Pacer::plan(std::uint64_t number, Time now) {
  if (!refreshes_.known()) {
    refreshes_.add(now);
    guessed_ = true;
  }
  const Duration lead_time = lead();
  const Duration period = refreshes_.period();
  // Half a period of play, since an estimate may move a little between two frames.
  const Time taken = last_refresh_ ? *last_refresh_ + period / 2 : Time::min();
  Plan plan;
  plan.refresh = refreshes_.next_after(std::max(now + lead_time, taken));
  plan.wake = late_ ? std::max(now, plan.refresh - lead_time) : now;
  if (last_refresh_) {
    const double steps = std::round(count(plan.refresh - *last_refresh_) / count(period));
    plan.skipped = steps > 1 ? static_cast<std::uint64_t>(steps) - 1 : 0;
  }
  last_refresh_ = plan.refresh;
  planned_[number % kRemembered] = {number, plan.refresh};
  return plan;
}

void Pacer::took(Duration time) { times_[time_count_++ % kRemembered] = time; }

bool Pacer::shown(std::uint64_t number, Time when) {
  if (last_shown_ && number <= *last_shown_) return false;
  last_shown_ = number;
  if (std::exchange(guessed_, false)) refreshes_.start_over();
  refreshes_.add(when);
  const Planned& planned = planned_[number % kRemembered];
  if (planned.number != number || planned.refresh == Time{}) return false;
  const bool missed = when - planned.refresh > refreshes_.period() / 2;
  if (missed) {
    margin_ = std::min(rounded(kMarginGrowth * count(margin_)),
                       rounded(kMostMarginPart * count(refreshes_.period())));
  } else {
    margin_ = std::max(kLeastMargin, rounded(kMarginDecay * count(margin_)));
  }
  return missed;
}

}  // namespace veneer::daemon
