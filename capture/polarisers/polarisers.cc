// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/polarisers.h"

#include <algorithm>
#include <array>

#include "capture/polarisers/elliptec/elliptec.h"
#include "capture/polarisers/hand/hand.h"

namespace veneer::capture {

std::span<const PolariserDriver> polariser_drivers() {
  static constexpr std::array kDrivers{
      PolariserDriver{
          "elliptec", "Thorlabs ELL14 and kin, over a serial port", open_elliptec_polariser},
      PolariserDriver{"hand", "a person turns it when asked", open_hand_polariser},
  };
  return kDrivers;
}

Result<std::unique_ptr<Polariser>> open_polariser(TomlReader& config, Hands& hands) {
  std::string name = "hand";
  config.read("driver", name);
  const auto drivers = polariser_drivers();
  const auto found = std::ranges::find(drivers, name, &PolariserDriver::name);
  if (found != drivers.end()) return found->open(config, hands);
  std::string names;
  for (const PolariserDriver& each : drivers)
    names += (names.empty() ? "" : ", ") + std::string(each.name);
  return fail(
      Errc::kInvalidOption, "polariser.driver is \"{}\"; the drivers there are: {}", name, names);
}

}  // namespace veneer::capture
