// SPDX-License-Identifier: Apache-2.0
#include "service/status.h"

namespace veneer::service {

std::string_view name_of(State state) {
  constexpr std::array<std::string_view, kStateCount> kNames{
      "starting", "running", "degraded", "blank", "fault", "stopping"};
  return kNames[static_cast<std::size_t>(state)];
}

std::string_view name_of(FaultKind kind) {
  constexpr std::array<std::string_view, kFaultKindCount> kNames{"tracker",
                                                                 "output",
                                                                 "gpu",
                                                                 "profile",
                                                                 "material",
                                                                 "scene",
                                                                 "configuration",
                                                                 "disk",
                                                                 "projector",
                                                                 "projector-state",
                                                                 "late",
                                                                 "memory"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::optional<State> state_named(std::string_view name) {
  for (std::size_t i = 0; i < kStateCount; ++i)
    if (name_of(static_cast<State>(i)) == name) return static_cast<State>(i);
  return {};
}

std::optional<FaultKind> fault_kind_named(std::string_view name) {
  for (std::size_t i = 0; i < kFaultKindCount; ++i)
    if (name_of(static_cast<FaultKind>(i)) == name) return static_cast<FaultKind>(i);
  return {};
}

State effect_of(FaultKind kind) {
  switch (kind) {
    case FaultKind::kOutput:
      return State::kFault;
    case FaultKind::kGpu:
      return State::kBlank;
    default:
      return State::kDegraded;
  }
}

Duration recovery_time_of(FaultKind kind) {
  switch (kind) {
    case FaultKind::kTracker:
      return std::chrono::seconds(2);
    case FaultKind::kOutput:
      return std::chrono::seconds(3);
    case FaultKind::kGpu:
      return std::chrono::seconds(5);
    // Found by looking once a minute, or when somebody asks for it.
    case FaultKind::kProjector:
    case FaultKind::kProjectorState:
      return std::chrono::seconds(65);
    case FaultKind::kMemory:
    case FaultKind::kDisk:
      return std::chrono::seconds(30);
    case FaultKind::kLate:
      return std::chrono::seconds(5);
    case FaultKind::kProfile:
    case FaultKind::kMaterial:
    case FaultKind::kScene:
    case FaultKind::kConfiguration:
      return std::chrono::seconds(10);
  }
  return {};
}

}  // namespace veneer::service
