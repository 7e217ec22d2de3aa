// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spdlog/common.h>
#include <sys/stat.h>

#include <string>
#include <string_view>
#include <vector>

namespace veneer::service {

/// Whether a JOURNAL_STREAM of the environment ("device:inode") names this file: then what is
/// written there goes to the journal anyway, and may as well go with its fields.
[[nodiscard]] bool names_file(std::string_view journal_stream, const struct stat& file);

/// "FIELD=value" as they are sent for a line of the log.
/// @param file   empty where it is not known.
/// @param extra  fields besides, complete.
[[nodiscard]] std::vector<std::string> journal_fields(std::string_view identifier,
                                                      spdlog::level::level_enum level,
                                                      std::string_view text,
                                                      std::string_view file,
                                                      int line,
                                                      const std::vector<std::string>& extra);

/// The fields that log_fault() and log_state() give to the line that this thread logs now; empty
/// otherwise. For sinks, which run on the thread that logs.
[[nodiscard]] const std::vector<std::string>& fields_of_this_line();

}  // namespace veneer::service
