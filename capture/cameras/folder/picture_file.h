// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/image.h"
#include "base/result.h"

namespace veneer::capture {

/// What a file's name says of it.
enum class PictureKind : std::uint8_t {
  kNone,     ///< no picture
  kLinear,   ///< PNG, TIFF, EXR: linear if whoever wrote it left it so
  kEncoded,  ///< JPEG
  kRaw,      ///< a camera's RAW, to be converted first
};
[[nodiscard]] PictureKind kind_of(const std::filesystem::path& path);

/// Seconds, where the file itself says so: the EXIF of a TIFF.
[[nodiscard]] std::optional<double> exposure_of(const std::filesystem::path& path);

struct PictureCounts {
  Image<Rgb16> counts;  ///< a grey file repeats its value
  std::uint16_t full_scale = 65535;
};

/// Reads PNG and TIFF of 8 or 16 bits and JPEG as they are; in EXR and float TIFF 1 is full scale,
/// negative values become 0.
/// @param full_scale  counts of a saturated pixel; 0: 255 for 8 bits, else 65535.
/// Errors: kNotFound, kBadFormat.
[[nodiscard]] Result<PictureCounts> read_picture(const std::filesystem::path& path,
                                                 std::uint16_t full_scale);

}  // namespace veneer::capture
