// SPDX-License-Identifier: Apache-2.0
#include "daemon/output_keeper.h"

#include <utility>

namespace veneer::daemon {

using service::FaultKind;

OutputKeeper::OutputKeeper(std::unique_ptr<projector::Output> output,
                           OpenOutput open,
                           Clock& clock,
                           Faults& faults)
    : output_(std::move(output)),
      open_(std::move(open)),
      clock_(clock),
      faults_(faults),
      description_(output_->description()) {}

OutputKeeper::Outcome OutputKeeper::heard(const Status& status) {
  if (status) {
    if (!last_) {
      faults_.end(FaultKind::kOutput, clock_.now());
      last_ = {};
    }
    backoff_.succeeded();
    return Outcome::kDone;
  }
  if (status.error().code == Errc::kCancelled) return Outcome::kClosed;
  const bool away = status.error().code == Errc::kUnavailable;
  // The same trouble frame after frame is told once.
  if (last_ || last_.error().what != status.error().what) {
    last_ = status;
    faults_.begin(FaultKind::kOutput,
                  clock_.now(),
                  fmt::format("{}; {}",
                              status.error().what,
                              away ? "frames are dropped until it takes them again"
                                   : "it is opened again and again until it works"));
  }
  if (!away) {
    failed_ = true;
    backoff_.failed(clock_.now());
  }
  return Outcome::kDropped;
}

OutputKeeper::Outcome OutputKeeper::present(const projector::Frame& frame) {
  return get() == nullptr ? Outcome::kDropped : heard(output_->present(frame));
}

OutputKeeper::Outcome OutputKeeper::blank() {
  return get() == nullptr ? Outcome::kDropped : heard(output_->blank());
}

bool OutputKeeper::reopen() {
  if (output_) {
    waits_before_ += output_->waits();
    output_.reset();
  }
  if (!backoff_.due(clock_.now())) return false;
  Result<std::unique_ptr<projector::Output>> opened = open_();
  if (!opened) {
    // Whatever the code says: there is none.
    (void)heard(fail(Errc::kIo, "opening the output again: {}", opened.error().what));
    return false;
  }
  output_ = *std::move(opened);
  {
    const std::scoped_lock lock(description_mutex_);
    description_ = output_->description();
  }
  failed_ = false;
  return true;
}

std::string OutputKeeper::description() const {
  const std::scoped_lock lock(description_mutex_);
  return description_;
}

std::uint64_t OutputKeeper::waits() const {
  return waits_before_ + (output_ ? output_->waits() : 0);
}

}  // namespace veneer::daemon
