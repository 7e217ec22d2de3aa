// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"
#include "daemon/config.h"

namespace veneer::daemon {

/// Whether what the configuration names is there at all, before any device is touched: a fresh
/// install has neither scene nor material nor profile. Errors: kNotFound, with what makes each one
/// that is missing.
[[nodiscard]] Status check_files_are_there(const Config& config);

}  // namespace veneer::daemon
