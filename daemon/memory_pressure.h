// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/result.h"

namespace veneer::daemon {

/// The part of the last ten seconds in which some program had to wait for memory, 0 to 1, of what
/// Linux says in /proc/pressure/memory ("some avg10", Documentation/accounting/psi.rst).
/// Errors: kBadFormat.
[[nodiscard]] Result<double> parse_memory_pressure(std::string_view text);
/// Of this machine. Errors: kUnavailable (a kernel without pressure stall information).
[[nodiscard]] Result<double> memory_pressure();

}  // namespace veneer::daemon
