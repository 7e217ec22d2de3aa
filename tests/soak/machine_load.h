// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>

namespace veneer::soak {

/// How busy other programs keep the machine: all processors' time less our own.
class MachineLoad {
 public:
  /// Looks, twice a second at most. Returns whether others had more than a tenth of the processors
  /// between the last two looks; false where the kernel does not tell.
  bool busy();

 private:
  struct Look {
    std::chrono::steady_clock::time_point time;
    double all_s = 0;   ///< processor time that anyone used
    double ours_s = 0;  ///< of this
  };
  static std::optional<Look> look();
  std::optional<Look> last_;
  bool busy_ = false;
};

}  // namespace veneer::soak
