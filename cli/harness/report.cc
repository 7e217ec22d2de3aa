// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/files.h"
#include "base/report_page.h"
#include "cli/harness/harness_run.h"

namespace veneer::cli {
namespace {

using nlohmann::ordered_json;

constexpr char kPage[] =
#include "cli/harness/harness.html.inc"
    ;

/// What is drawn over time.
constexpr std::array kCurves{"position_error_mm", "picture_de00", "specular_weight", "pose_age_ms"};

ordered_json number_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json json_of(const Verdict& verdict) {
  const Expectation& e = verdict.expectation;
  ordered_json json{{"quantity", e.quantity},
                    {"statistic", e.statistic},
                    {"value", number_or_null(verdict.value)},
                    {"met", verdict.met},
                    {"why", e.why}};
  if (!e.quantity.starts_with("counter.")) {
    json["from_s"] = e.from_s;
    json["to_s"] = e.to_s;
  }
  if (e.at_most) json["at_most"] = *e.at_most;
  if (e.at_least) json["at_least"] = *e.at_least;
  return json;
}

}  // namespace

Status write_harness_report(const Scenario& scenario,
                            const HarnessRun& run,
                            const std::vector<Verdict>& verdicts,
                            const std::filesystem::path& folder) {
  ordered_json verdict{{"scenario", scenario.name()}, {"about", scenario.about}};
  verdict["met"] = std::ranges::all_of(verdicts, &Verdict::met);
  for (const Verdict& each : verdicts) verdict["expectations"].push_back(json_of(each));
  verdict["counters"] = run.counters;
  VENEER_TRY(write_text(folder / "verdict.json", verdict.dump(2) + "\n"));

  ordered_json data = verdict;
  data["seconds"] = run.seconds;
  for (const char* name : kCurves) {
    ordered_json& curve = data["curves"][name] = ordered_json::array();
    for (const double value : run.quantities.at(name)) curve.push_back(number_or_null(value));
  }
  data["faults"] = ordered_json::array();
  for (const tracking::Fault& fault : scenario.faults) {
    data["faults"].push_back({{"kind", name_of(fault.kind)},
                              {"from_s", fault.at_s},
                              {"to_s", fault.at_s + fault.for_s}});
  }
  data["events"] = ordered_json::array();
  for (const HarnessRun::Event& event : run.events) {
    data["events"].push_back(
        {{"s", event.seconds}, {"state", event.state}, {"detail", event.detail}});
  }
  return write_text(folder / "index.html", page_with_data(kPage, data));
}

}  // namespace veneer::cli
