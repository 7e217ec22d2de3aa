// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "service/status.h"

namespace veneer::service {

/// Makes the logger of the whole program (spdlog's default): to the journal, with fields, where
/// standard error is the journal, else to standard error. systemd.journal-fields(7) says what the
/// fields mean. Once, before other threads log.
void log_as(const std::string& identifier);

/// Logs that a fault has begun, or is over, with the fields VENEER_FAULT (its kind) and
/// VENEER_FAULT_BEGUN (1 or 0), by which journalctl finds it. May wait for the journal, as all
/// logging may: not for the frame loop.
void log_fault(const Fault& fault, bool begun);

/// Logs a new state with the field VENEER_STATE; `why` in words, may be empty. Likewise.
void log_state(State state, std::string_view why = {});

}  // namespace veneer::service
