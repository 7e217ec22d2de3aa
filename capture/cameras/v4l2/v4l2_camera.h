// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/cameras/cameras.h"

namespace veneer::capture {

/// A webcam or other camera of V4L2, streamed with OpenCV. Keys:
///
///     device = "/dev/video0"  # or below /dev/v4l/by-id/, which stays the same
///     format = "YUYV"         # one of the camera's; absent: what it is set to
///     width = 1280            # with height; absent: what it is set to
///     height = 720
///     fps = 30
///     bits = 12               # of "Y16": those that the camera uses, 9 to 16 (16)
///     gain = 0                # in the camera's own unit, which V4L2 does not say
///
/// Automatic exposure, gain and white balance are off, or it does not open. Counts of 8 bits (full
/// scale 255) are as good as always encoded by the camera with a curve of its own, which has to be
/// recovered; "Y16" is linear with most. "GREY" and "Y16" repeat their value, the others are
/// converted to RGB by OpenCV.
///
/// A grab throws pictures away until one comes whose exposure began after the call, by the kernel's
/// time stamps: four buffers wait in the queue and one is being filled. Where a driver's stamps are
/// not of the monotonic clock it throws five away. After a change of the exposure it throws three
/// more, for which sensors still use the old one. Where the camera has no exposure to set,
/// exposure_range() is 0 to 0, set_exposure() fails with kUnavailable and exposure_s is the frame's
/// interval. An attempt to read blocks for ten seconds at most (OpenCV's limit).
///
/// Errors: kNotFound, kUnavailable (in use: by whom; no permission: which group; an automatic that
/// stays on), kInvalidOption (a value that the camera does not have, with those that it has).
[[nodiscard]] Result<std::unique_ptr<Camera>> open_v4l2(TomlReader& config);
[[nodiscard]] Result<std::vector<CameraInfo>> list_v4l2();

}  // namespace veneer::capture
