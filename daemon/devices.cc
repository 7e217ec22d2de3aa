// SPDX-License-Identifier: Apache-2.0
#include "daemon/devices.h"

#include <utility>

#include "projector/control_watch.h"
#include "projector/controls.h"
#include "projector/outputs.h"
#include "tracking/drivers.h"

namespace veneer::daemon {
namespace {

/// Opens what one table of the configuration names, as it was read: who edits the file meanwhile
/// does not take away what runs.
template <class Open>
auto open_from(const TomlReader& toml, std::string_view key, const Open& open)
    -> decltype(open(std::declval<TomlReader&>())) {
  TomlReader fresh = toml.again();
  fresh.ignore_the_rest();
  TomlReader table = fresh.table(key);
  auto opened = open(table);
  if (opened) VENEER_TRY(fresh.finish());
  return opened;
}

}  // namespace

Devices completed(Devices devices,
                  const TomlReader& toml,
                  const std::filesystem::path& state_directory) {
  if (!devices.open_tracker) {
    devices.open_tracker = [toml](Clock& clock) {
      return open_from(toml, "tracker", [&clock](TomlReader& table) {
        return tracking::open_tracker(table, clock);
      });
    };
  }
  if (!devices.open_output) {
    devices.open_output = [toml, state_directory] {
      return open_from(toml, "output", [&state_directory](TomlReader& table) {
        return projector::open_output(table, state_directory);
      });
    };
  }
  if (!devices.open_control && toml.contains("control")) {
    devices.open_control = [toml](Clock& clock) {
      return open_from(toml, "control", [&clock](TomlReader& table) {
        static_cast<void>(projector::ControlWatchOptions::read(table));  // the daemon's own key
        return projector::open_control(table, clock);
      });
    };
  }
  if (!devices.make_renderer) devices.make_renderer = render::Renderer::create;
  return devices;
}

}  // namespace veneer::daemon
