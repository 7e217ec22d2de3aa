// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace veneer::cli {

/// What a row of values may be summed up as.
[[nodiscard]] bool is_statistic(std::string_view name);
[[nodiscard]] std::string statistic_names();
/// @param name    for which is_statistic() holds.
/// @param values  not empty.
[[nodiscard]] double statistic(std::string_view name, const std::vector<double>& values);

}  // namespace veneer::cli
