// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "base/result.h"
#include "daemon/backoff.h"
#include "daemon/faults.h"
#include "projector/output.h"

namespace veneer::daemon {

/// The output, whatever happens to it: drops what it does not take, and opens it again when it has
/// failed. The frame loop's own.
class OutputKeeper {
 public:
  using OpenOutput = std::function<Result<std::unique_ptr<projector::Output>>()>;
  /// Borrows the clock and the faults.
  OutputKeeper(std::unique_ptr<projector::Output> output,
               OpenOutput open,
               Clock& clock,
               Faults& faults);

  enum class Outcome {
    kDone,
    kDropped,  ///< nothing was shown; kOutput is among the faults
    kClosed,   ///< somebody closed it: the run is over
  };
  /// What an answer of the output means.
  Outcome heard(const Status& status);
  Outcome present(const projector::Frame& frame);
  Outcome blank();

  /// Null while it is away.
  [[nodiscard]] projector::Output* get() const { return failed_ ? nullptr : output_.get(); }
  /// It has failed for good, and is to be closed and opened again.
  [[nodiscard]] bool failed() const { return failed_; }
  /// Does so where it is time. Nothing may use what it lent any more. Returns whether it is back.
  bool reopen();
  /// Whether the last thing that it was given did not go out.
  [[nodiscard]] const Status& last() const { return last_; }

  [[nodiscard]] std::uint64_t waits() const;
  /// Any thread may ask.
  [[nodiscard]] std::string description() const;

 private:
  std::unique_ptr<projector::Output> output_;
  OpenOutput open_;
  Clock& clock_;
  Faults& faults_;
  Backoff backoff_;
  mutable std::mutex description_mutex_;
  std::string description_;
  Status last_;
  bool failed_ = false;
  std::uint64_t waits_before_ = 0;  // of outputs that were closed
};

}  // namespace veneer::daemon
