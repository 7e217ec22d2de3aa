// SPDX-License-Identifier: Apache-2.0
#include "cli/doctor/connector_text.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace veneer::cli {
namespace {

/// "SEC EPSON PJ, serial 1234", as far as the display says.
std::string identity_of(const projector::KmsDisplay& display) {
  std::string text = display.maker;
  const auto add = [&text](std::string_view separator, const std::string& part) {
    if (part.empty()) return;
    if (!text.empty()) text += separator;
    text += part;
  };
  add(" ", display.name);
  if (!display.serial.empty()) add(", ", "serial " + display.serial);
  return text.empty() ? "a display without a name" : text;
}

}  // namespace

std::string text_of(const projector::KmsDisplay& display) {
  std::string text =
      fmt::format("{} of {} ({}): ", display.connector, display.device, display.driver);
  if (!display.connected) return text + "nothing is plugged in";
  text += identity_of(display);
  if (display.modes.empty()) {
    text += "; it offers no mode";
  } else {
    text += "; " + display.modes.front();
    const std::size_t more = display.modes.size() - 1;
    if (more > 0) text += fmt::format(" and {} more mode{}", more, more == 1 ? "" : "s");
  }
  return text + (display.in_use ? "; in use" : "");
}

nlohmann::ordered_json json_of(const projector::KmsDisplay& display) {
  return {{"device", display.device},
          {"driver", display.driver},
          {"connector", display.connector},
          {"connected", display.connected},
          {"in_use", display.in_use},
          {"maker", display.maker},
          {"name", display.name},
          {"serial", display.serial},
          {"modes", display.modes}};
}

}  // namespace veneer::cli
