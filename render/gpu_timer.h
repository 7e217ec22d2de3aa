// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <array>
#include <cstdint>
#include <optional>

#include "render/gl_objects.h"

namespace veneer::render {

/// Measures how long the GPU works on a stretch of commands and on the first part of it, without
/// ever waiting for it.
class GpuTimer {
 public:
  GpuTimer();
  /// Where all queries are still on their way this stretch is not measured.
  void begin();
  /// Ends the first part.
  void split();
  void end();

  struct Times {
    double first_ms = 0;  ///< from begin() to split()
    double all_ms = 0;
  };
  /// Of the newest stretch whose results have arrived.
  [[nodiscard]] std::optional<Times> times();

 private:
  enum class SlotState { kFree, kRunning, kPending };
  struct Slot {
    // Moments, not stretches: of two stretches in a row llvmpipe counts much of the first twice.
    std::array<GlQuery, 3> moments;  // begin, split, end
    SlotState state = SlotState::kFree;
  };
  std::array<Slot, 4> slots_;  // used in turn; the results arrive in the same order
  std::size_t next_ = 0;
  std::optional<Times> newest_;
};

}  // namespace veneer::render
