// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/cameras/cameras.h"

namespace veneer::capture {

/// A digital SLR or mirrorless camera through libgphoto2, remotely released; its pictures are
/// fetched and then deleted on the camera. Keys:
///
///     model = "Nikon DSC D7100"  # as `gphoto2 --auto-detect` writes it; either may be left out
///     port = "usb:001,004"       # where that leaves one camera
///     iso = 100                  # fixed; required where the camera would choose by itself
///     white_balance = "Daylight" # the camera's names; RAW counts do not depend on it
///     image_format = "RAW"
///     allow_encoded = false      # take JPEG, which is not linear, where no RAW comes
///     answer_s = 30              # how long the camera may take beyond the exposure
///
/// RAW pictures give linear counts (see decode_raw()), JPEG ones codes with full scale 255, whose
/// curve is the camera's own. exposure_s is what the camera calls its shutter speed. `time` counts
/// from the moment at which the camera was told to release: its lag is in it. Opening takes one
/// picture, by which size and format are known and which proves that the camera can take one.
///
/// A camera that hangs is left to itself after the time that it may take: a thread goes on waiting
/// for it and ends with its connection.
///
/// Errors: kNotFound, kUnavailable (another program holds it: which; no permission; an automatic
/// that cannot be switched off), kInvalidOption (several cameras; a value that it does not have;
/// pictures that are not RAW), those of grab().
[[nodiscard]] Result<std::unique_ptr<Camera>> open_gphoto2(TomlReader& config);
/// Errors: kIo.
[[nodiscard]] Result<std::vector<CameraInfo>> list_gphoto2();

}  // namespace veneer::capture
