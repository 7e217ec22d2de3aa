// SPDX-License-Identifier: Apache-2.0
#include "cli/service/status_text.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

#include "base/exit_code.h"

namespace veneer::cli {
namespace {

using nlohmann::ordered_json;
using service::Fault;
using service::ServiceStatus;
using service::State;

/// A row of the table; nothing where there is nothing to say.
std::string row(std::string_view name, const std::string& value) {
  return value.empty() ? "" : fmt::format("\n{:<10} {}", name, value);
}

std::string latency_table(const service::LatencyBudget& budget) {
  std::string names;
  std::string values;
  for (const service::LatencyStage& stage : service::kLatencyStages) {
    const std::string value = fmt::format("{:.2f}", budget.*stage.milliseconds);
    const std::size_t width = std::max(stage.name.size(), value.size()) + 2;
    names += fmt::format("{:>{}}", stage.name, width);
    values += fmt::format("{:>{}}", value, width);
  }
  return fmt::format(
      "\n{:<10}{}   total\n{:<10}{}{:>8.2f}", "latency", names, "  ms", values, budget.total());
}

/// JSON has no other numbers.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json();
}

}  // namespace

std::string age_text(Duration age) {
  const auto seconds =
      std::max<std::int64_t>(std::chrono::floor<std::chrono::seconds>(age).count(), 0);
  constexpr std::int64_t kMinute = 60;
  constexpr std::int64_t kHour = 60 * kMinute;
  constexpr std::int64_t kDay = 24 * kHour;
  if (seconds < kMinute) return fmt::format("{} s", seconds);
  if (seconds < kHour) return fmt::format("{} min", seconds / kMinute);
  if (seconds < kDay) return fmt::format("{} h", seconds / kHour);
  return fmt::format("{} d", seconds / kDay);
}

std::string table_of(const ServiceStatus& status, Time now) {
  std::string text = fmt::format("{:<10} {}", "state", name_of(status.state));
  for (const Fault& each : status.faults)
    text += fmt::format("\n{:<10} {} for {}: {}",
                        "fault",
                        name_of(each.kind),
                        age_text(now - each.since),
                        each.text);
  text += row("material", status.material);
  text += row("profile", status.profile);
  text += row("scene", status.scene);
  text += row("tracker", status.tracker);
  text += row("output", status.output);
  text += row("projector", status.projector);
  text += row("renderer", status.renderer);
  text += row("quality", status.quality);
  if (status.luminance_ceiling > 0)
    text += row("ceiling", fmt::format("{:g} cd/m^2", status.luminance_ceiling));
  text += fmt::format("\n{:<10} {:.1f} a second; {:.2f} ms to make, {:.2f} ms at most for 95 %",
                      "frames",
                      status.frame_rate_hz,
                      status.frame_ms_median,
                      status.frame_ms_p95);
  text += fmt::format("\n{:<10} {} shown, {} dropped, {} late; {} faults overcome",
                      "so far",
                      status.frames,
                      status.dropped,
                      status.late,
                      status.recovered);
  return text + latency_table(status.latency_ms);
}

std::string line_of(const ServiceStatus& status, Time now) {
  std::string text = fmt::format("{}  {:.1f} frames a second  {:.2f} ms from pose to light",
                                 name_of(status.state),
                                 status.frame_rate_hz,
                                 status.latency_ms.total());
  for (const Fault& each : status.faults)
    text += fmt::format("  {} for {}", name_of(each.kind), age_text(now - each.since));
  return text;
}

ordered_json json_of(const ServiceStatus& status, Time now) {
  ordered_json faults = ordered_json::array();
  for (const Fault& each : status.faults)
    faults.push_back({{"kind", name_of(each.kind)},
                      {"age_s", to_seconds(now - each.since)},
                      {"text", each.text}});
  ordered_json latency;
  for (const service::LatencyStage& stage : service::kLatencyStages)
    latency[std::string(stage.name)] = number(status.latency_ms.*stage.milliseconds);
  latency["total"] = number(status.latency_ms.total());
  return {{"state", name_of(status.state)},
          {"faults", faults},
          {"material", status.material},
          {"profile", status.profile},
          {"scene", status.scene},
          {"tracker", status.tracker},
          {"output", status.output},
          {"projector", status.projector},
          {"renderer", status.renderer},
          {"quality", status.quality},
          {"luminance_ceiling_nits", number(status.luminance_ceiling)},
          {"frame_rate_hz", number(status.frame_rate_hz)},
          {"frame_ms_median", number(status.frame_ms_median)},
          {"frame_ms_p95", number(status.frame_ms_p95)},
          {"gpu_ms_median", number(status.gpu_ms_median)},
          {"latency_ms", latency},
          {"frames", status.frames},
          {"dropped", status.dropped},
          {"late", status.late},
          {"recovered", status.recovered}};
}

int exit_code_of(const ServiceStatus& status) {
  switch (status.state) {
    case State::kDegraded:
    case State::kBlank:
    case State::kFault:
      return kExitGateMissed;
    default:
      return kExitDone;
  }
}

}  // namespace veneer::cli
