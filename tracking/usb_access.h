// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/result.h"
#include "tracking/usb_devices.h"

namespace veneer::tracking {

/// Where the system shows devices and programs; others in tests.
struct SystemFolders {
  std::filesystem::path usb = "/sys/bus/usb/devices";
  std::filesystem::path dev = "/dev";
  std::filesystem::path proc = "/proc";
};

/// Whether a tracker that is plugged in could be opened by this program, now. Opens nothing, so
/// that whoever uses it is not disturbed. Errors, each with its remedy: kUnavailable (it lacks its
/// firmware, it may not be opened, another program holds it; which one is known only of the
/// programs that this one may look into), kNotFound (it went away meanwhile), kIo.
[[nodiscard]] Status check_access(const UsbDevice& device, const SystemFolders& folders = {});

}  // namespace veneer::tracking
