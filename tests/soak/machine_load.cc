// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/machine_load.h"

#include <chrono>

namespace veneer::soak {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(500);
/// Of all processors. The kernel's own work and an idle desktop take a few hundredths.
constexpr double kBusy = 0.1;

}  // namespace

bool MachineLoad::busy() {
  if (last_ && std::chrono::steady_clock::now() - last_->when < kInterval) return busy_;
  const std::optional<ProcessorTime> now = processor_time();
  if (now && last_) busy_ = share_of_others(*last_, *now).value_or(0.0) > kBusy;
  last_ = now;
  return busy_;
}

}  // namespace veneer::soak
