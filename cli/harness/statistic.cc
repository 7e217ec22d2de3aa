// SPDX-License-Identifier: Apache-2.0
#include "cli/harness/statistic.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/result.h"
#include "base/statistics.h"

namespace veneer::cli {
namespace {

using Values = std::vector<double>;

constexpr std::array kStatistics{
    std::pair{std::string_view("last"), +[](const Values& v) { return v.back(); }},
    std::pair{std::string_view("max"),
              +[](const Values& v) { return *std::ranges::max_element(v); }},
    std::pair{std::string_view("mean"), +[](const Values& v) { return mean(v); }},
    std::pair{std::string_view("min"),
              +[](const Values& v) { return *std::ranges::min_element(v); }},
    std::pair{std::string_view("p50"), +[](const Values& v) { return quantile(v, 0.5); }},
    std::pair{std::string_view("p95"), +[](const Values& v) { return quantile(v, 0.95); }},
    std::pair{std::string_view("rms"),
              +[](const Values& v) {
                double sum = 0;
                for (const double value : v) sum += value * value;
                return std::sqrt(sum / static_cast<double>(v.size()));
              }},
};

const auto* find(std::string_view name) {
  return std::ranges::find(kStatistics, name, [](const auto& entry) { return entry.first; });
}

}  // namespace

bool is_statistic(std::string_view name) { return find(name) != kStatistics.end(); }

std::string statistic_names() {
  std::vector<std::string_view> names;
  for (const auto& entry : kStatistics) names.push_back(entry.first);
  return fmt::format("{}", fmt::join(names, ", "));
}

double statistic(std::string_view name, const Values& values) {
  VENEER_CHECK(is_statistic(name) && !values.empty());
  return find(name)->second(values);
}

}  // namespace veneer::cli
