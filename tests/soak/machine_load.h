// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/processor_time.h"

namespace veneer::soak {

/// How busy other programs keep the machine: all processors' time less our own.
class MachineLoad {
 public:
  /// Looks, twice a second at most. Returns whether others had more than a tenth of the processors
  /// between the last two looks; false where the kernel does not tell.
  bool busy();

 private:
  std::optional<ProcessorTime> last_;
  bool busy_ = false;
};

}  // namespace veneer::soak
