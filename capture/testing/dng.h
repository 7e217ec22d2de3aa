// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/image.h"

namespace veneer::capture::testing {

/// The bytes of a DNG file (Adobe 2012, "Digital Negative (DNG) Specification", version 1.4) with
/// an uncompressed mosaic R G; G B of 16 bits.
[[nodiscard]] std::string bayer_dng(const Image<std::uint16_t>& mosaic, std::uint16_t white_level);
/// The bytes of a grey JPEG picture whose pixels are all `code`.
[[nodiscard]] std::string grey_jpeg(int width, int height, std::uint8_t code);

}  // namespace veneer::capture::testing
