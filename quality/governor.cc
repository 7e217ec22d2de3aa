// SPDX-License-Identifier: Apache-2.0
#include "quality/governor.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace veneer::quality {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kEnough = 12;  // frames, to say something of a rung
constexpr double kNear = 0.97;       // of the deadline: so near that frames will miss it
constexpr double kRoomDown = 0.92;   // a rung below is wanted to keep to this part
constexpr double kMost = 0.90;   // the quantile that may not come near; single hiccups are beyond
constexpr double kUpper = 0.95;  // the quantile that must have room on a better rung
constexpr double kOften = 0.02;  // of the history: twice as many as may miss
constexpr std::size_t kFewest = 5;       // misses, to say that they are often
constexpr Duration kLeastPatience = 2s;  // of room, before a step up
constexpr Duration kMostPatience = 120s;
constexpr Duration kSoon = 30s;     // a rung left within this time was a mistake
constexpr Duration kSettled = 60s;  // one that was kept so long was none
constexpr Duration kPause = 2s;     // between frames: what was learned of the load is old
constexpr double kLearning = 0.7;   // of what a step says about the ratio of two rungs
constexpr double kMostError = 4.0;  // a ratio is not believed to be further off in one step

}  // namespace

Result<GovernorMode> parse_governor_mode(std::string_view text) {
  for (const GovernorMode mode :
       {GovernorMode::kFixed, GovernorMode::kDeadline, GovernorMode::kBest}) {
    if (text == name_of(mode)) return mode;
  }
  return fail(Errc::kInvalidOption,
              "the quality's mode \"{}\" is none of \"fixed\", \"deadline\" and \"best\"",
              text);
}

std::string_view name_of(GovernorMode mode) {
  switch (mode) {
    case GovernorMode::kFixed:
      return "fixed";
    case GovernorMode::kDeadline:
      return "deadline";
    case GovernorMode::kBest:
      break;
  }
  return "best";
}

Governor::Governor(const GovernorOptions& options, std::vector<double> ratios)
    : options_(options), ratio_(std::move(ratios)) {
  VENEER_CHECK(!ratio_.empty() && options.deadline_ms > 0.0 && options.fade_frames >= 0);
  VENEER_CHECK(std::ranges::all_of(ratio_, [](double r) { return std::isfinite(r) && r > 0.0; }));
  patience_.assign(ratio_.size(), kLeastPatience);
  room_since_.assign(ratio_.size(), std::nullopt);
  if (options_.mode == GovernorMode::kFixed)
    rung_ = std::min(options_.fixed_rung, ratio_.size() - 1);
  from_ = rung_;
}

void Governor::set_deadline(double ms) {
  VENEER_CHECK(ms > 0.0);
  options_.deadline_ms = ms;
}

void Governor::begin_on(std::size_t rung) {
  if (options_.mode != GovernorMode::kDeadline) return;
  rung_ = from_ = std::min(rung, ratio_.size() - 1);
}

Governor::Choice Governor::next(Time now) {
  if (last_ && (now < *last_ || now - *last_ > kPause)) {
    // The machine slept, or the clock was set: nothing is known of the load any more.
    seen_ = 0;
    before_.reset();
    forget_room();
    if (stepped_ && *stepped_ > now) stepped_ = now;
  }
  last_ = now;
  if (options_.mode == GovernorMode::kDeadline && fade_left_ == 0) consider(now);
  if (fade_left_ == 0) return {rung_, rung_, 0.0};
  // fade_frames frames lie between the two rungs, none of them on either.
  const double fade = 1.0 - fade_left_ / (options_.fade_frames + 1.0);
  --fade_left_;
  return {from_, rung_, fade};
}

void Governor::took(const Choice& choice, double ms) {
  if (!std::isfinite(ms) || ms < 0.0) return;
  if (choice.level != choice.next_level || choice.level != rung_) return;
  history_[seen_ % kHistory] = ms;
  ++seen_;
  if (seen_ == kEnough) learn();
}

void Governor::forget_room() { std::ranges::fill(room_since_, std::nullopt); }

std::optional<double> Governor::quantile(double part) const {
  const std::size_t count = std::min(seen_, kWindow);
  if (count < kEnough) return std::nullopt;
  std::array<double, kWindow> sorted{};
  for (std::size_t i = 0; i < count; ++i) sorted[i] = last(i);
  const auto begin = sorted.begin();
  const auto nth = begin + static_cast<std::ptrdiff_t>(part * static_cast<double>(count - 1) + 0.5);
  std::nth_element(begin, nth, begin + static_cast<std::ptrdiff_t>(count));
  return *nth;
}

bool Governor::misses() const {
  if (seen_ < kRecent) return false;
  std::size_t missed = 0;
  for (std::size_t i = 0; i < kRecent; ++i) missed += last(i) > options_.deadline_ms ? 1 : 0;
  return 2 * missed >= kRecent;
}

bool Governor::comes_near() const {
  // Of few frames, a tenth is chance.
  return seen_ >= kWindow && *quantile(kMost) > kNear * options_.deadline_ms;
}

bool Governor::misses_often() const {
  const std::size_t count = std::min(seen_, kHistory);
  std::size_t missed = 0;
  for (std::size_t i = 0; i < count; ++i) missed += last(i) > options_.deadline_ms ? 1 : 0;
  return missed >= kFewest && static_cast<double>(missed) > kOften * static_cast<double>(count);
}

bool Governor::is_overloaded() const {
  return rung_ + 1 == ratio_.size() && fade_left_ == 0 && misses();
}

double Governor::expected(std::size_t rung, double ms_here) const {
  return ms_here * ratio_[rung] / ratio_[rung_];
}

void Governor::learn() {
  if (!before_ || from_ == rung_) return;
  const double here = *quantile(0.5);
  if (*before_ > 0.0 && here > 0.0) {
    const double assumed = ratio_[rung_] / ratio_[from_];
    const double wrong = std::clamp(here / *before_ / assumed, 1.0 / kMostError, kMostError);
    // The worse rungs are put right with this one: what made it dearer than was measured (another
    // GPU, another window size) mostly does so to them as well.
    const double factor = std::pow(wrong, kLearning);
    if (rung_ > from_) {
      for (std::size_t i = rung_; i < ratio_.size(); ++i) ratio_[i] *= factor;
    } else {
      for (std::size_t i = 0; i <= rung_; ++i) ratio_[i] *= factor;
    }
  }
  before_.reset();
}

std::size_t Governor::rung_below(double ms_here) const {
  std::size_t rung = rung_ + 1;
  while (rung + 1 < ratio_.size() && expected(rung, ms_here) > kRoomDown * options_.deadline_ms)
    ++rung;
  return rung;
}

void Governor::step(std::size_t rung, Time now) {
  before_ = quantile(0.5);
  from_ = rung_;
  rung_ = rung;
  fade_left_ = options_.fade_frames;
  seen_ = 0;
  stepped_ = now;
  forget_room();
  ++steps_;
}

void Governor::consider(Time now) {
  const bool may_step = !stepped_ || now - *stepped_ >= options_.least_between_steps;
  if (tried_ && *tried_ == rung_ && now - *stepped_ > kSettled) {
    patience_[rung_] = kLeastPatience;
    tried_.reset();
  }
  if (misses() || comes_near() || misses_often()) {
    forget_room();
    if (!may_step || rung_ + 1 == ratio_.size()) return;
    if (tried_ && *tried_ == rung_ && now - *stepped_ < kSoon)
      patience_[rung_] = std::min(2 * patience_[rung_], kMostPatience);
    tried_.reset();
    // What frames take now: with few on this rung, or since the load came, the last ones.
    std::array<double, kRecent> recent{};
    for (std::size_t i = 0; i < kRecent; ++i) recent[i] = last(i);
    std::ranges::sort(recent);
    step(rung_below(recent[kRecent / 2]), now);
    return;
  }
  const std::optional<double> upper = quantile(kUpper);
  if (!upper || rung_ == 0) return;
  std::optional<std::size_t> best;  // that has had room for long enough
  for (std::size_t rung = 0; rung < rung_; ++rung) {
    if (expected(rung, *upper) > options_.room_up * options_.deadline_ms) {
      room_since_[rung].reset();
      continue;
    }
    if (!room_since_[rung]) room_since_[rung] = now;
    if (!best && now - *room_since_[rung] >= patience_[rung]) best = rung;
  }
  if (!best || !may_step) return;
  step(*best, now);
  tried_ = best;
}

}  // namespace veneer::quality
