// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "capture/cameras/aravis/internal_glib.h"
#include "capture/cameras/cameras.h"

namespace veneer::capture {

/// What answers on every network and USB, sorted by identity; waits a second for answers.
[[nodiscard]] std::vector<CameraInfo> discover_cameras();

/// Opens the camera of that name (identity, serial number or MAC address) or at that IP address;
/// the only one that answers where both are empty.
/// Errors: kNotFound, naming those that answer; kUnavailable; kInvalidOption.
[[nodiscard]] Result<GObjectPtr<ArvCamera>> open_device(const std::string& name,
                                                        const std::string& address);

}  // namespace veneer::capture
