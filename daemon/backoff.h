// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "base/clock.h"

namespace veneer::daemon {

/// When to try again what has failed: soon, then ever more seldom, but never less than once in
/// `most`, so that a recovery is quick however long the trouble was.
class Backoff {
 public:
  explicit Backoff(Duration first = std::chrono::milliseconds(100),
                   Duration most = std::chrono::seconds(1))
      : first_(first), most_(most), wait_(first) {}
  [[nodiscard]] bool due(Time now) const { return now >= next_; }
  void failed(Time now) {
    next_ = now + wait_;
    wait_ = std::min(2 * wait_, most_);
  }
  void succeeded() {
    wait_ = first_;
    next_ = Time::min();
  }

 private:
  Duration first_;
  Duration most_;
  Duration wait_;
  Time next_ = Time::min();
};

}  // namespace veneer::daemon
