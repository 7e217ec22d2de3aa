// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated_device/fault_plan.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace veneer::tracking {
namespace {

constexpr std::array kNames{
    std::pair{FaultKind::kBitFlip, std::string_view("bit-flip")},
    std::pair{FaultKind::kBurst, std::string_view("burst")},
    std::pair{FaultKind::kClockFreeze, std::string_view("clock-freeze")},
    std::pair{FaultKind::kClockRestart, std::string_view("clock-restart")},
    std::pair{FaultKind::kDelay, std::string_view("delay")},
    std::pair{FaultKind::kDrop, std::string_view("drop")},
    std::pair{FaultKind::kDuplicate, std::string_view("duplicate")},
    std::pair{FaultKind::kGarbage, std::string_view("garbage")},
    std::pair{FaultKind::kInvalid, std::string_view("invalid")},
    std::pair{FaultKind::kIoError, std::string_view("io-error")},
    std::pair{FaultKind::kMirror, std::string_view("mirror")},
    std::pair{FaultKind::kOtherDevice, std::string_view("other-device")},
    std::pair{FaultKind::kReorder, std::string_view("reorder")},
    std::pair{FaultKind::kSilence, std::string_view("silence")},
    std::pair{FaultKind::kStall, std::string_view("stall")},
    std::pair{FaultKind::kTeleport, std::string_view("teleport")},
    std::pair{FaultKind::kText, std::string_view("text")},
    std::pair{FaultKind::kThin, std::string_view("thin")},
    std::pair{FaultKind::kUnplug, std::string_view("unplug")},
};

/// Whether it is a matter of single frames, each of a body.
bool strikes_bodies(FaultKind kind) {
  return kind == FaultKind::kBitFlip || kind == FaultKind::kDrop || kind == FaultKind::kInvalid ||
         kind == FaultKind::kMirror || kind == FaultKind::kTeleport;
}

using Name = decltype(kNames)::value_type;

void check_range(TomlReader& toml, std::string_view key, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    toml.add_error(key, fmt::format("{} is outside {} to {}", value, least, most));
  }
}

}  // namespace

std::string_view name_of(FaultKind kind) {
  return std::ranges::find(kNames, kind, &Name::first)->second;
}

std::vector<Fault> read_faults(TomlReader& toml) {
  std::vector<Fault> faults;
  for (TomlReader& table : toml.tables("fault")) {
    Fault fault;
    std::string kind;
    table.require("kind", kind);
    const auto name = std::ranges::find(kNames, kind, &Name::second);
    if (name != kNames.end()) {
      fault.kind = name->first;
    } else {
      std::string known;
      for (const Name& each : kNames) known += fmt::format(" \"{}\"", each.second);
      table.add_error("kind", fmt::format("\"{}\" is none of{}", kind, known));
    }
    table.require("at_s", fault.at_s);
    table.read("for_s", fault.for_s);
    table.read("share", fault.share);
    table.read("body", fault.body);
    table.read("samples", fault.samples);
    table.read("delay_ms", fault.delay_ms);
    table.read("shift_m", fault.shift_m);
    check_range(table, "at_s", fault.at_s, 0, 1e6);
    check_range(table, "for_s", fault.for_s, 0, 1e6);
    check_range(table, "share", fault.share, 0, 1);
    check_range(table, "samples", fault.samples, 1, 1000);
    check_range(table, "delay_ms", fault.delay_ms, 0, 10000);
    const bool once = fault.kind == FaultKind::kClockRestart || fault.kind == FaultKind::kText ||
                      fault.kind == FaultKind::kOtherDevice;
    if (!once && !(fault.for_s > 0)) {
      table.add_error("for_s", "is not above 0: it would never strike");
    }
    if (fault.body != 0 && !strikes_bodies(fault.kind)) {
      table.add_error("body", "this kind strikes the device, not one of its bodies");
    }
    if (!fault.shift_m.allFinite()) table.add_error("shift_m", "is not finite");
    faults.push_back(fault);
  }
  return faults;
}

}  // namespace veneer::tracking
