// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/camera.h"

namespace veneer::capture {

/// A camera that is there, without opening it.
struct CameraInfo {
  std::string driver;
  std::string model;
  /// What the key of that driver's table that names a camera takes ("address", "device", ...).
  std::string identity;
  std::string state;  ///< empty, or what stands in the way ("gvfsd-gphoto2, process 812, holds it")
};

/// One line of the registry of cameras.
struct CameraDriver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [camera] table; the driver reads its own keys, the caller calls finish().
  /// Errors: kNotFound (not there), kUnavailable (another program holds it, and which),
  /// kInvalidOption.
  Result<std::unique_ptr<Camera>> (*open)(TomlReader& config);
  /// Cameras that are there. Errors: kIo, kUnavailable.
  Result<std::vector<CameraInfo>> (*list)();
};

/// Every driver, sorted by name: "aravis" (GenICam over Ethernet and USB3), "folder" (pictures on
/// disk), "gphoto2" (DSLR), "v4l2".
[[nodiscard]] std::span<const CameraDriver> camera_drivers();
/// Opens the camera that the key `driver` of the table names, and sets what all have in common, in
/// this order: pixel_format, gain_db, trigger ("free", "software", "hardware"), exposure_s. A key
/// that is absent leaves the camera as its driver opens it.
/// Errors: kInvalidOption, and those of the driver and of Camera's setters.
[[nodiscard]] Result<std::unique_ptr<Camera>> open_camera(TomlReader& config);

/// A driver that could not look for its cameras.
struct CameraListFailure {
  std::string_view driver;
  Error error;
};
struct CameraList {
  std::vector<CameraInfo> found;
  std::vector<CameraListFailure> failed;
};
/// Asks every driver. Takes as long as the slowest bus: a second or two for cameras on Ethernet,
/// whose answers have to be waited for.
[[nodiscard]] CameraList list_cameras();

}  // namespace veneer::capture
