// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <array>
#include <cstdint>
#include <optional>

#include "render/gl_objects.h"

namespace veneer::render {

/// Measures how long the GPU works on a stretch of commands, without ever waiting for it.
class GpuTimer {
 public:
  GpuTimer();
  /// Where all queries are still on their way this stretch is not measured.
  void begin();
  void end();
  /// Of the newest stretch whose result has arrived.
  [[nodiscard]] std::optional<double> milliseconds();

 private:
  enum class SlotState { kFree, kRunning, kPending };
  struct Slot {
    GlQuery query;
    SlotState state = SlotState::kFree;
  };
  std::array<Slot, 4> slots_;  // used in turn; the results arrive in the same order
  std::size_t next_ = 0;
  std::optional<double> newest_ms_;
};

}  // namespace veneer::render
