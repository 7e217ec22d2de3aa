// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>

#include "base/clock.h"
#include "service/status.h"

namespace veneer::cli {

/// A status for people, with the faults' ages at `now` and where the latency went. No end of line.
[[nodiscard]] std::string table_of(const service::ServiceStatus& status, Time now);
/// The same on one line: state, frame rate, latency, faults.
[[nodiscard]] std::string line_of(const service::ServiceStatus& status, Time now);
/// The same for programs: times in seconds or milliseconds, as the names say.
[[nodiscard]] nlohmann::ordered_json json_of(const service::ServiceStatus& status, Time now);

/// "3 s", "12 min", "5 h", "8 d": whole units, cut; a time that has not come yet is "0 s".
[[nodiscard]] std::string age_text(Duration age);

/// 0 while all is well (or it starts or stops as it should), 3 while something is missing from the
/// picture.
[[nodiscard]] int exit_code_of(const service::ServiceStatus& status);

}  // namespace veneer::cli
