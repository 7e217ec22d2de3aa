// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/camera.h"

namespace veneer::capture {

/// The keys of the driver's table that do not say which camera; see docs/howto/camera.md.
struct AravisOptions {
  double timeout_s = 3;
  int full_scale = 0;           ///< 0: as the pixel format says
  int packet_size = 0;          ///< 0: as the camera has it
  double packet_delay_us = -1;  ///< below 0: as the camera has it
  std::optional<int> gain_raw;
  Mosaic layout = Mosaic::kNone;

  /// Errors: kInvalidOption.
  [[nodiscard]] static Result<AravisOptions> read(TomlReader& config);
};

}  // namespace veneer::capture
