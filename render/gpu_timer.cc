// SPDX-License-Identifier: Apache-2.0
#include "render/gpu_timer.h"

namespace veneer::render {

GpuTimer::GpuTimer() {
  for (Slot& slot : slots_) {
    for (GlQuery& moment : slot.moments) moment = make_query(GL_TIMESTAMP);
  }
}

void GpuTimer::begin() {
  Slot& slot = slots_[next_];
  if (slot.state == SlotState::kPending) {
    static_cast<void>(times());
    if (slot.state == SlotState::kPending) return;
  }
  glQueryCounter(slot.moments[0].id(), GL_TIMESTAMP);
  slot.state = SlotState::kRunning;
}

void GpuTimer::split() {
  Slot& slot = slots_[next_];
  if (slot.state != SlotState::kRunning) return;
  glQueryCounter(slot.moments[1].id(), GL_TIMESTAMP);
}

void GpuTimer::end() {
  Slot& slot = slots_[next_];
  if (slot.state != SlotState::kRunning) return;
  glQueryCounter(slot.moments[2].id(), GL_TIMESTAMP);
  slot.state = SlotState::kPending;
  next_ = (next_ + 1) % slots_.size();
}

std::optional<GpuTimer::Times> GpuTimer::times() {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    Slot& slot = slots_[(next_ + i) % slots_.size()];  // the oldest first
    if (slot.state != SlotState::kPending) continue;
    GLint available = GL_FALSE;
    glGetQueryObjectiv(slot.moments[2].id(), GL_QUERY_RESULT_AVAILABLE, &available);
    if (available != GL_TRUE) break;
    std::array<GLuint64, 3> ns{};
    for (std::size_t k = 0; k < ns.size(); ++k)
      glGetQueryObjectui64v(slot.moments[k].id(), GL_QUERY_RESULT, &ns[k]);
    newest_ = {static_cast<double>(ns[1] - ns[0]) * 1e-6,
               static_cast<double>(ns[2] - ns[0]) * 1e-6};
    slot.state = SlotState::kFree;
  }
  return newest_;
}

}  // namespace veneer::render
