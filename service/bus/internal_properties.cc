// SPDX-License-Identifier: Apache-2.0
#include "service/bus/internal_properties.h"

#include "service/bus/command.h"

namespace veneer::service {
namespace {

using WireFault = sdbus::Struct<std::string, std::int64_t, std::string>;
using WireBudget = std::map<std::string, double>;

/// A property from how its value is read off a status, and put into one.
template <class T>
Property property(std::string name,
                  bool urgent,
                  T (*get)(const ServiceStatus&),
                  Status (*set)(ServiceStatus&, const T&)) {
  return {std::move(name),
          sdbus::signature_of<T>::str(),
          urgent,
          [get](sdbus::Message& message, const ServiceStatus& s) { message << get(s); },
          [get](const ServiceStatus& a, const ServiceStatus& b) { return get(a) == get(b); },
          [set](const sdbus::Variant& value, ServiceStatus& s) { return set(s, value.get<T>()); }};
}

template <auto kMember>
Property text(std::string name) {
  return property<std::string>(
      std::move(name),
      false,
      [](const ServiceStatus& s) { return readable(s.*kMember); },
      [](ServiceStatus& s, const std::string& value) {
        s.*kMember = value;
        return Status{};
      });
}

template <class T, auto kMember>
Property number(std::string name) {
  return property<T>(
      std::move(name),
      false,
      [](const ServiceStatus& s) -> T { return s.*kMember; },
      [](ServiceStatus& s, const T& value) {
        s.*kMember = value;
        return Status{};
      });
}

std::string state_on_the_wire(const ServiceStatus& status) {
  return std::string(name_of(status.state));
}

Status take_state(ServiceStatus& status, const std::string& name) {
  const std::optional<State> state = state_named(name);
  if (!state) return fail(Errc::kBadFormat, "\"{}\" is no state", readable(name));
  status.state = *state;
  return {};
}

std::vector<WireFault> faults_on_the_wire(const ServiceStatus& status) {
  std::vector<WireFault> faults;
  for (const Fault& fault : status.faults)
    faults.emplace_back(
        std::string(name_of(fault.kind)),
        std::chrono::floor<std::chrono::microseconds>(fault.since.time_since_epoch()).count(),
        readable(fault.text));
  return faults;
}

Status take_faults(ServiceStatus& status, const std::vector<WireFault>& faults) {
  // Beyond this a time in nanoseconds, as ours are, does not fit.
  constexpr std::int64_t kMost = std::int64_t{1} << 53;
  status.faults.clear();
  for (const WireFault& each : faults) {
    const std::string& name = std::get<0>(each);
    const std::int64_t since_us = std::get<1>(each);
    const std::optional<FaultKind> kind = fault_kind_named(name);
    if (!kind) return fail(Errc::kBadFormat, "\"{}\" is no kind of fault", readable(name));
    if (since_us < -kMost || since_us > kMost)
      return fail(Errc::kBadFormat, "a fault began at {} microseconds", since_us);
    status.faults.push_back({*kind, Time{std::chrono::microseconds(since_us)}, std::get<2>(each)});
  }
  return {};
}

WireBudget budget_on_the_wire(const ServiceStatus& status) {
  WireBudget budget;
  for (const LatencyStage& stage : kLatencyStages)
    budget[std::string(stage.name)] = status.latency_ms.*stage.milliseconds;
  return budget;
}

Status take_budget(ServiceStatus& status, const WireBudget& budget) {
  for (const LatencyStage& stage : kLatencyStages) {
    const auto found = budget.find(std::string(stage.name));
    if (found != budget.end()) status.latency_ms.*stage.milliseconds = found->second;
  }
  return {};
}

std::vector<Property> make_properties() {
  using S = ServiceStatus;
  return {
      property<std::string>("State", true, &state_on_the_wire, &take_state),
      property<std::vector<WireFault>>("Faults", true, &faults_on_the_wire, &take_faults),
      text<&S::material>("Material"),
      text<&S::profile>("Profile"),
      text<&S::scene>("Scene"),
      text<&S::tracker>("Tracker"),
      text<&S::output>("Output"),
      text<&S::renderer>("Renderer"),
      text<&S::projector>("Projector"),
      text<&S::quality>("QualityLevel"),
      number<double, &S::frame_rate_hz>("FrameRate"),
      number<double, &S::frame_ms_median>("FrameMsMedian"),
      number<double, &S::frame_ms_p95>("FrameMsP95"),
      number<double, &S::gpu_ms_median>("GpuMsMedian"),
      property<double>(
          "Latency",
          false,
          [](const S& s) { return s.latency_ms.total(); },
          [](S&, const double&) { return Status{}; }),  // the sum of the budget
      property<WireBudget>("LatencyBudget", false, &budget_on_the_wire, &take_budget),
      number<double, &S::luminance_ceiling>("LuminanceCeiling"),
      number<std::uint64_t, &S::frames>("Frames"),
      number<std::uint64_t, &S::dropped>("Dropped"),
      number<std::uint64_t, &S::late>("Late"),
      number<std::uint64_t, &S::recovered>("Recovered"),
  };
}

}  // namespace

const std::vector<Property>& properties() {
  static const std::vector<Property> kProperties = make_properties();
  return kProperties;
}

Result<ServiceStatus> status_of(const std::map<std::string, sdbus::Variant>& values) {
  ServiceStatus status;
  for (const Property& each : properties()) {
    const auto found = values.find(each.name);
    if (found == values.end()) continue;
    const std::string doing = fmt::format("reading {} of {}", each.name, "veneerd");
    try {
      if (const Status taken = each.take(found->second, status); !taken)
        return fail_while(doing, taken.error());
    } catch (const sdbus::Error& error) {
      return fail(Errc::kBadFormat,
                  "{}: it holds another type than {}; is the service of another version?",
                  doing,
                  each.signature);
    }
  }
  return status;
}

}  // namespace veneer::service
