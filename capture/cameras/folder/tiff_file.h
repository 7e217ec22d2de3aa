// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/result.h"

namespace veneer::capture {

/// Samples of a TIFF, pixel by pixel from the top left.
struct TiffSamples {
  int width = 0, height = 0;
  int channels = 1;                   ///< 1 or 3: alpha is dropped
  int bits = 16;                      ///< 8, 16, or 32
  std::vector<std::uint16_t> counts;  ///< of 8 and 16 bits
  std::vector<float> values;          ///< of 32, which are floats
};

/// The first picture of a file, of grey or RGB, in strips, not planar; any orientation is left as
/// it is stored. Errors: kBadFormat.
[[nodiscard]] Result<TiffSamples> read_tiff(const std::filesystem::path& path);

/// Seconds, from the file's EXIF; none where it does not say.
[[nodiscard]] std::optional<double> tiff_exposure(const std::filesystem::path& path);

}  // namespace veneer::capture
