// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

#include "cli/track/session.h"
#include "tracking/status.h"

// How a tracker does, in words and as JSON.
namespace veneer::cli {

/// One line: the device, its state and why.
[[nodiscard]] std::string state_line(const tracking::Tracker& tracker);
/// A heading, then a line for every body of `whole`; rate, latency and jitter are those of
/// `recent`.
[[nodiscard]] std::vector<std::string> body_table(const BodyStatistics& whole,
                                                  const BodyStatistics& recent);
/// The counters that are not zero: "12 lost, 1 restart"; empty where all is well.
[[nodiscard]] std::string trouble_line(const tracking::TrackerCounters& counters);

[[nodiscard]] nlohmann::ordered_json json_of(const BodyStatistics& bodies);
[[nodiscard]] nlohmann::ordered_json json_of(const tracking::TrackerStatus& status);

}  // namespace veneer::cli
