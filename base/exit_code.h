// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"

namespace veneer {

/// Exit codes of every program of Veneer.
inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;
inline constexpr int kExitGateMissed = 3;  ///< finished, but a stated quality gate was missed

[[nodiscard]] inline int exit_code_of(const Error& error) {
  return error.code == Errc::kInvalidOption ? kExitUsage : kExitFailed;
}

}  // namespace veneer
