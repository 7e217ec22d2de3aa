// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/image.h"
#include "base/result.h"

namespace veneer::capture {

/// What a RAW file holds: counts as the sensor's converter gave them, the black level in them; no
/// white balance, no gamma, no colour matrix.
struct RawPicture {
  /// The visible part, not turned. Every pixel has its own colour exactly as read; the other two
  /// are means of the nearest pixels that have them, which is linear in the counts.
  Image<Rgb16> counts;
  /// A value that was averaged from a pixel at full scale is at full scale too.
  std::uint16_t full_scale = 65535;
};

/// Decodes with LibRaw what it knows: a colour mosaic (Bayer, X-Trans), a monochrome sensor, three
/// linear samples a pixel.
/// @param name  for messages.
/// Errors: kBadFormat (not a RAW file that LibRaw knows, damaged, cut, too large).
[[nodiscard]] Result<RawPicture> decode_raw(const std::string& bytes, const std::string& name);

}  // namespace veneer::capture
