// SPDX-License-Identifier: Apache-2.0
#include "daemon/faults.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace veneer::daemon {

using service::Fault;
using service::FaultKind;
using service::State;

namespace {

std::size_t index_of(FaultKind kind) { return static_cast<std::size_t>(kind); }
std::uint32_t bit_of(FaultKind kind) { return 1U << static_cast<unsigned>(kind); }

}  // namespace

bool Faults::begin(FaultKind kind, Time now, std::string_view text) {
  const std::scoped_lock lock(mutex_);
  std::optional<Fault>& fault = faults_[index_of(kind)];
  if (fault && fault->text == text) return false;
  const State before = state_locked();
  const bool is_new = !fault;
  present_ |= bit_of(kind);
  if (is_new) fault = Fault{kind, now, {}};
  fault->text = text;
  note({fault, true, before, fault->text});
  note_state(before);
  return is_new;
}

bool Faults::end(FaultKind kind, Time now) {
  if (!has(kind)) return false;
  const std::scoped_lock lock(mutex_);
  std::optional<Fault>& fault = faults_[index_of(kind)];
  if (!fault) return false;
  const State before = state_locked();
  note({fault,
        false,
        before,
        fmt::format("after {:.1f} s", std::max(0.0, to_seconds(now - fault->since)))});
  fault.reset();
  present_ &= ~bit_of(kind);
  ++recovered_;
  note_state(before);
  return true;
}

void Faults::first_frame() {
  const std::scoped_lock lock(mutex_);
  const State before = state_locked();
  shown_ = true;
  note_state(before);
}

void Faults::ask_for_dark(bool dark) {
  const std::scoped_lock lock(mutex_);
  const State before = state_locked();
  dark_asked_ = dark;
  note_state(before);
}

void Faults::stopping() {
  const std::scoped_lock lock(mutex_);
  const State before = state_locked();
  stopping_ = true;
  note_state(before);
}

State Faults::state_locked() const {
  if (stopping_) return State::kStopping;
  State worst = State::kRunning;
  for (const std::optional<Fault>& fault : faults_)
    if (fault) worst = std::max(worst, effect_of(fault->kind));
  if (dark_asked_) worst = std::max(worst, State::kBlank);
  return shown_ || worst >= State::kBlank ? worst : State::kStarting;
}

void Faults::note(Change change) {
  if (changes_.size() < kRememberedChanges) changes_.push_back(std::move(change));
}

void Faults::note_state(State before) {
  const State after = state_locked();
  if (after != before) note({std::nullopt, false, after, fmt::format("after {}", name_of(before))});
}

State Faults::state() const {
  const std::scoped_lock lock(mutex_);
  return state_locked();
}

bool Faults::has(FaultKind kind) const { return (present_ & bit_of(kind)) != 0; }

std::vector<Fault> Faults::list() const {
  const std::scoped_lock lock(mutex_);
  std::vector<Fault> faults;
  for (const std::optional<Fault>& fault : faults_)
    if (fault) faults.push_back(*fault);
  std::ranges::stable_sort(faults, {}, &Fault::since);
  return faults;
}

std::uint64_t Faults::recovered() const {
  const std::scoped_lock lock(mutex_);
  return recovered_;
}

std::vector<Faults::Change> Faults::take_changes() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(changes_, {});
}

}  // namespace veneer::daemon
