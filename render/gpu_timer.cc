// SPDX-License-Identifier: Apache-2.0
#include "render/gpu_timer.h"

namespace veneer::render {

GpuTimer::GpuTimer() {
  for (Slot& slot : slots_) slot.query = make_query(GL_TIME_ELAPSED);
}

void GpuTimer::begin() {
  Slot& slot = slots_[next_];
  if (slot.state == SlotState::kPending) {
    static_cast<void>(milliseconds());
    if (slot.state == SlotState::kPending) return;
  }
  glBeginQuery(GL_TIME_ELAPSED, slot.query.id());
  slot.state = SlotState::kRunning;
}

void GpuTimer::end() {
  Slot& slot = slots_[next_];
  if (slot.state != SlotState::kRunning) return;
  glEndQuery(GL_TIME_ELAPSED);
  slot.state = SlotState::kPending;
  next_ = (next_ + 1) % slots_.size();
}

std::optional<double> GpuTimer::milliseconds() {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    Slot& slot = slots_[(next_ + i) % slots_.size()];  // the oldest first
    if (slot.state != SlotState::kPending) continue;
    GLint available = GL_FALSE;
    glGetQueryObjectiv(slot.query.id(), GL_QUERY_RESULT_AVAILABLE, &available);
    if (available != GL_TRUE) break;
    GLuint64 nanoseconds = 0;
    glGetQueryObjectui64v(slot.query.id(), GL_QUERY_RESULT, &nanoseconds);
    newest_ms_ = static_cast<double>(nanoseconds) * 1e-6;
    slot.state = SlotState::kFree;
  }
  return newest_ms_;
}

}  // namespace veneer::render
