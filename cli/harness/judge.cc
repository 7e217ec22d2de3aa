// SPDX-License-Identifier: Apache-2.0
#include <fmt/ranges.h>

#include <cmath>
#include <limits>

#include "cli/harness/harness_run.h"
#include "cli/harness/statistic.h"

namespace veneer::cli {
namespace {

constexpr std::string_view kCounter = "counter.";

template <class Map>
std::string names_of(const Map& map) {
  std::vector<std::string> names;
  for (const auto& [name, value] : map) names.push_back(name);
  return fmt::format("{}", fmt::join(names, ", "));
}

Result<double> value_of(const Expectation& expectation, const HarnessRun& run) {
  if (expectation.quantity.starts_with(kCounter)) {
    const auto counter = run.counters.find(expectation.quantity.substr(kCounter.size()));
    if (counter != run.counters.end()) return counter->second;
    return fail(Errc::kInvalidOption,
                "expecting \"{}\": there is no such counter; there are {}",
                expectation.quantity,
                names_of(run.counters));
  }
  const auto found = run.quantities.find(expectation.quantity);
  if (found == run.quantities.end()) {
    return fail(Errc::kInvalidOption,
                "expecting \"{}\": there is no such quantity; there are {}, and counter.NAME",
                expectation.quantity,
                names_of(run.quantities));
  }
  std::vector<double> values;
  for (std::size_t i = 0; i < run.seconds.size(); ++i) {
    const bool within = run.seconds[i] >= expectation.from_s && run.seconds[i] <= expectation.to_s;
    if (within && !std::isnan(found->second[i])) values.push_back(found->second[i]);
  }
  return values.empty() ? std::numeric_limits<double>::quiet_NaN()
                        : statistic(expectation.statistic, values);
}

}  // namespace

Result<std::vector<Verdict>> judge(const std::vector<Expectation>& expectations,
                                   const HarnessRun& run) {
  std::vector<Verdict> verdicts;
  for (const Expectation& expectation : expectations) {
    Verdict verdict{expectation, 0, false};
    VENEER_ASSIGN(verdict.value, value_of(expectation, run));
    // What was not measured meets nothing: NaN compares false.
    verdict.met = (!expectation.at_most || verdict.value <= *expectation.at_most) &&
                  (!expectation.at_least || verdict.value >= *expectation.at_least);
    verdicts.push_back(std::move(verdict));
  }
  return verdicts;
}

}  // namespace veneer::cli
