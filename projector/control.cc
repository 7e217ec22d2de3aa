// SPDX-License-Identifier: Apache-2.0
#include "projector/control.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace veneer::projector {
namespace {

constexpr std::string_view kPrefix = "projector.";

/// Keys of the record whose change moves colours, and what the value is called.
struct Watched {
  std::string_view key;
  std::string_view called;
};
constexpr std::array kWatched{
    Watched{"power", "the power"},
    Watched{"input", "the input"},
    Watched{"input_resolution", "the resolution of the input"},
    Watched{"muted", "the mute of the picture"},
    Watched{"frozen", "the freeze"},
    Watched{"degamma", "the projector's own tone curve (degamma)"},
    Watched{"processing", "the processing of the picture"},
    Watched{"led_levels", "the LED levels (red, green, blue)"},
    Watched{"led_enable", "what lights the LEDs"},
    Watched{"lamps_on", "which lamps burn"},
    Watched{"model", "the model"},
    Watched{"serial", "the serial number"},
    Watched{"firmware", "the firmware"},
};

std::string key_of(std::string_view name) { return std::string(kPrefix) + std::string(name); }

const std::string* find(const ControlRecord& record, std::string_view name) {
  const auto found = record.find(key_of(name));
  return found == record.end() ? nullptr : &found->second;
}

/// "1200 34" as numbers; those up to the first that is none.
std::vector<int> numbers_of(const std::string& text) {
  std::vector<int> numbers;
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  while (at < end) {
    int value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{}) break;
    numbers.push_back(value);
    at = next < end && *next == ' ' ? next + 1 : next;
  }
  return numbers;
}

bool holds(const ControlRecord& record, std::string_view name, std::string_view value) {
  const std::string* const found = find(record, name);
  return found != nullptr && *found == value;
}

/// Whether a part was in no better health than it is now.
bool holds_health(const ControlRecord& record, const std::string& part, Health now) {
  const std::string name = "health." + part;
  return holds(record, name, name_of(Health::kError)) ||
         (now == Health::kWarning && holds(record, name, name_of(now)));
}

tl::unexpected<Error> cannot(const ProjectorControl& control, std::string_view what) {
  return fail(Errc::kUnavailable,
              "{}: it has no command to {}; do it in the projector's own menu if it is there",
              control.description(),
              what);
}

}  // namespace

std::string_view name_of(Power power) {
  switch (power) {
    case Power::kOff:
      return "off";
    case Power::kOn:
      return "on";
    case Power::kCooling:
      return "cooling";
    case Power::kWarmUp:
      return "warming up";
    case Power::kUnknown:
      break;
  }
  return "unknown";
}

std::string_view name_of(Health health) {
  switch (health) {
    case Health::kWarning:
      return "warning";
    case Health::kError:
      return "error";
    case Health::kOk:
      break;
  }
  return "ok";
}

ControlRecord to_record(const ProjectorState& state) {
  ControlRecord record;
  const auto put = [&](std::string_view name, std::string value) {
    record[key_of(name)] = std::move(value);
  };
  const auto put_flag = [&](std::string_view name, const std::optional<bool>& flag) {
    if (flag) put(name, *flag ? "on" : "off");
  };
  const auto put_text = [&](std::string_view name, const std::optional<std::string>& text) {
    if (text) put(name, *text);
  };
  if (state.power != Power::kUnknown) put("power", std::string(name_of(state.power)));
  put_text("input", state.input);
  put_text("input_label", state.input_label);
  const auto put_size = [&](std::string_view name, const std::optional<Resolution>& size) {
    if (size) put(name, fmt::format("{}x{}", size->width, size->height));
  };
  put_size("input_resolution", state.input_resolution);
  put_size("panel_resolution", state.panel_resolution);
  put_flag("muted", state.muted);
  put_flag("frozen", state.frozen);
  put_flag("locked", state.locked);
  put_flag("degamma", state.degamma);
  put_flag("processing", state.processing);
  put_text("led_enable", state.led_enable);
  put_text("maker", state.maker);
  put_text("model", state.model);
  put_text("name", state.name);
  put_text("serial", state.serial);
  put_text("firmware", state.firmware);
  if (state.led_levels) {
    const LedLevels& led = *state.led_levels;
    put("led_levels", fmt::format("{} {} {}", led[0], led[1], led[2]));
  }
  if (state.lamps) {
    std::string hours;
    std::string on;
    for (const Lamp& lamp : *state.lamps) {
      hours += fmt::format("{}{}", hours.empty() ? "" : " ", lamp.hours);
      on += fmt::format("{}{}", on.empty() ? "" : " ", lamp.on ? "on" : "off");
    }
    put("lamp_hours", hours);
    put("lamps_on", on);
  }
  for (const auto& [part, health] : state.health)
    put("health." + part, std::string(name_of(health)));
  return record;
}

std::vector<std::string> differences(const ControlRecord& then, const ControlRecord& now) {
  std::vector<std::string> changed;
  for (const auto& [key, called] : kWatched) {
    const std::string* const before = find(then, key);
    const std::string* const after = find(now, key);
    if (before != nullptr && after != nullptr && *before != *after)
      changed.push_back(fmt::format("{} was \"{}\" and is \"{}\"", called, *before, *after));
  }
  const std::string* const before = find(then, "lamp_hours");
  const std::string* const after = find(now, "lamp_hours");
  if (before == nullptr || after == nullptr) return changed;
  const std::vector<int> old_hours = numbers_of(*before);
  const std::vector<int> new_hours = numbers_of(*after);
  for (std::size_t i = 0; i < std::min(old_hours.size(), new_hours.size()); ++i)
    if (new_hours[i] < old_hours[i])
      changed.push_back(fmt::format(
          "lamp {} was replaced: it had {} hours and has {}", i + 1, old_hours[i], new_hours[i]));
  return changed;
}

std::vector<std::string> differences(const ProjectorState& then, const ProjectorState& now) {
  return differences(to_record(then), to_record(now));
}

std::vector<std::string> warnings(const ProjectorState& state) { return warnings(state, {}); }

std::vector<std::string> warnings(const ProjectorState& state, const ControlRecord& kept) {
  std::vector<std::string> result;
  if (state.power != Power::kOn && state.power != Power::kUnknown)
    result.push_back(fmt::format("it is {}, not on", name_of(state.power)));
  if (state.frozen == true)
    result.push_back("the picture is frozen: what is drawn does not show; unfreeze it");
  if (state.muted == true) result.push_back("the picture is blanked; unblank it");
  if (state.degamma == true && !holds(kept, "degamma", "on"))
    result.push_back(
        "its own tone curve (degamma) is on: switch it off, or calibrate with it and leave it");
  if (state.locked == false && !holds(kept, "locked", "off"))
    result.push_back("it is not locked to a signal: see to the cable, the input and the mode");
  if (state.input_resolution && state.panel_resolution &&
      state.input_resolution != state.panel_resolution) {
    const Resolution& in = *state.input_resolution;
    const Resolution& panel = *state.panel_resolution;
    if (!holds(kept, "input_resolution", fmt::format("{}x{}", in.width, in.height)) ||
        !holds(kept, "panel_resolution", fmt::format("{}x{}", panel.width, panel.height)))
      result.push_back(fmt::format(
          "it scales the picture, {} x {} pixels to {} x {} of its own; set the output's mode to "
          "those",
          in.width,
          in.height,
          panel.width,
          panel.height));
  }
  for (const auto& [part, health] : state.health)
    if (health != Health::kOk && !holds_health(kept, part, health))
      result.push_back(fmt::format("it reports: {} {}; see its manual", part, name_of(health)));
  return result;
}

Status ProjectorControl::set_degamma(bool /*on*/) { return cannot(*this, "set its tone curve"); }
Status ProjectorControl::set_led_levels(const LedLevels& /*levels*/) {
  return cannot(*this, "set LED levels");
}
Status ProjectorControl::set_processing(bool /*on*/) {
  return cannot(*this, "set the processing of the picture");
}
Status ProjectorControl::show_test_pattern(const std::string& /*name*/) {
  return cannot(*this, "show a test pattern");
}

}  // namespace veneer::projector
