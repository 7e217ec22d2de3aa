// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers.h"

#include <algorithm>
#include <array>
#include <string>

#include "tracking/drivers/freed/freed_tracker.h"
#include "tracking/drivers/osvr_hdk/osvr_hdk.h"
#include "tracking/drivers/polhemus/polhemus.h"
#include "tracking/drivers/razer_hydra/razer_hydra.h"
#include "tracking/drivers/replay/replay_tracker.h"
#include "tracking/drivers/simulated/simulated_tracker.h"
#include "tracking/drivers/simulated_device/simulated_device.h"
#include "tracking/drivers/vrpn/vrpn_tracker.h"

namespace veneer::tracking {
namespace {

template <class T>
Result<std::unique_ptr<Tracker>> open_as_tracker(TomlReader& config, Clock& clock) {
  return T::open(config, clock);
}

constexpr std::array kDrivers{
    Driver{"freed", "camera trackers and robotic heads that send FreeD by UDP", &open_freed},
    Driver{"osvr-hdk", "OSVR HDK: where a head looks", &open_osvr_hdk, &osvr_hdk_on_usb},
    Driver{"polhemus",
           "Polhemus LIBERTY, PATRIOT or FASTRAK, over USB",
           &open_polhemus,
           &polhemus_on_usb},
    Driver{"razer-hydra", "Razer Hydra: two controllers", &open_razer_hydra, &razer_hydra_on_usb},
    Driver{"replay", "a recording, at its own pace", &open_as_tracker<ReplayTracker>},
    Driver{"simulated", "bodies on scripted paths", &open_as_tracker<SimulatedTracker>},
    Driver{"simulated-device",
           "the same behind a real protocol, with planned faults",
           &open_simulated_device},
    Driver{"vrpn", "a tracker of a VRPN server", &open_vrpn},
};
static_assert(std::ranges::is_sorted(kDrivers, {}, &Driver::name));

}  // namespace

std::span<const Driver> drivers() { return kDrivers; }

Result<std::unique_ptr<Tracker>> open_tracker(TomlReader& config, Clock& clock) {
  std::string name;
  config.read("driver", name);
  const auto driver = std::ranges::find(kDrivers, name, &Driver::name);
  if (driver != kDrivers.end()) return driver->open(config, clock);
  std::string known;
  for (const Driver& each : kDrivers) known += fmt::format(" \"{}\"", each.name);
  return fail(Errc::kInvalidOption,
              "opening the tracker: no driver is called \"{}\"; set driver to one of{}",
              name,
              known);
}

}  // namespace veneer::tracking
