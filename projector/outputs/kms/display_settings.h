// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/result.h"
#include "projector/outputs/kms/display_choice.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

/// All that a display must be set to, so that one framebuffer and nothing else is seen on it, code
/// for code.
struct DisplaySettings {
  std::vector<KmsSetting> all;
  KmsId framebuffer_property = 0;  ///< of the plane: what a flip changes
};
/// Errors: kUnavailable (the card lacks what a picture needs), those of the device.
[[nodiscard]] Result<DisplaySettings> settings_of(
    KmsDevice& device, const DisplayChoice& display, KmsId mode_blob, KmsId framebuffer, int bits);

}  // namespace veneer::projector
