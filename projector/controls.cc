// SPDX-License-Identifier: Apache-2.0
#include "projector/controls.h"

#include <algorithm>
#include <array>
#include <string>

#include "projector/control/dlpc350/dlpc350.h"
#include "projector/control/pjlink/pjlink.h"

namespace veneer::projector {
namespace {

template <class T>
Result<std::unique_ptr<ProjectorControl>> open_as_control(TomlReader& config, Clock& clock) {
  return T::open(config, clock);
}

constexpr std::array kControls{
    ControlDriver{"dlpc350",
                  "TI DLPC350 light engines (LightCrafter 4500) on USB",
                  &open_as_control<Dlpc350>},
    ControlDriver{"pjlink", "projectors that speak PJLink, class 1 or 2", &open_as_control<Pjlink>},
};
static_assert(std::ranges::is_sorted(kControls, {}, &ControlDriver::name));

}  // namespace

std::span<const ControlDriver> control_drivers() { return kControls; }

Result<std::unique_ptr<ProjectorControl>> open_control(TomlReader& config, Clock& clock) {
  std::string name;
  config.read("driver", name);
  const auto driver = std::ranges::find(kControls, name, &ControlDriver::name);
  if (driver != kControls.end()) return driver->open(config, clock);
  std::string known;
  for (const ControlDriver& each : kControls) known += fmt::format(" \"{}\"", each.name);
  return fail(Errc::kInvalidOption,
              "opening the projector's control: none is called \"{}\"; set driver to one of{}",
              name,
              known);
}

}  // namespace veneer::projector
