// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/instruments/shown_patch.h"
#include "capture/camera.h"

namespace veneer::calibration {

/// What instruments borrow from who opens them; all of it must outlive the instrument. A null is
/// refused by the one that needs it.
struct InstrumentServices {
  Clock& clock;
  /// Asks a person to do something ("Place the instrument on its white reference") and returns when
  /// it is done. Errors: kCancelled. Where it is empty, what needs a person fails.
  std::function<Status(const std::string& what_to_do)> ask;
  const WatchedDisplay* display = nullptr;  ///< for "file"
  capture::Camera* camera = nullptr;        ///< for "camera"
};

/// One line of the registry of instruments.
struct InstrumentDriver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [instrument] table; the driver reads its own keys, the caller calls
  ///                finish().
  Result<std::unique_ptr<Colorimeter>> (*open)(TomlReader& config,
                                               const InstrumentServices& services);
};

/// Every instrument, sorted by name: "camera", "colorhug", "file", "spotread". The virtual one is
/// made by the bench (simulation/bench/), which alone knows what it looks at.
[[nodiscard]] std::span<const InstrumentDriver> instrument_drivers();
/// Opens the instrument that the key `driver` of the table names.
/// Errors: kInvalidOption, and those of the driver.
[[nodiscard]] Result<std::unique_ptr<Colorimeter>> open_instrument(
    TomlReader& config, const InstrumentServices& services);

/// A colorimeter that is plugged in.
struct ConnectedInstrument {
  std::string model;
  std::string usb_id;       ///< "273f:1004"
  std::string usb_port;     ///< "1-2.3"
  std::string serial;       ///< empty where it has none
  std::string_view driver;  ///< that reads it; empty where none can as it is now
  std::string remedy;       ///< what is to be done before it can be read; empty where nothing
};

/// The colorimeters among the devices on USB, sorted by port. Opens none of them. Errors: kIo.
[[nodiscard]] Result<std::vector<ConnectedInstrument>> connected_instruments();

}  // namespace veneer::calibration
