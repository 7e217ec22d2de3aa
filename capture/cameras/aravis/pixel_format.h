// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "base/image.h"
#include "base/result.h"
#include "capture/camera.h"

namespace veneer::capture {

/// How a GenICam camera lays out its pixels.
struct PixelFormat {
  enum class Packing : std::uint8_t {
    kBytes,  ///< one each
    kWords,  ///< two bytes each, the lower first
    kBits,   ///< "p": bits one after another, the lowest first
    kPairs,  ///< "Packed": two pixels in three bytes, the lower bits of both in the middle one
  };
  enum class Colours : std::uint8_t { kGrey, kRggb, kGrbg, kGbrg, kBggr, kRgb };

  int bits = 8;
  Packing packing = Packing::kBytes;
  Colours colours = Colours::kGrey;
  Mosaic mosaic = Mosaic::kNone;

  [[nodiscard]] std::uint16_t full_scale() const {
    return static_cast<std::uint16_t>((1U << static_cast<unsigned>(bits)) - 1);
  }
};

/// Mono, BayerRG, BayerGR, BayerGB and BayerBG of 8, 10, 12, 14 and 16 bits, with "p" and "Packed";
/// RGB8; and with Sony's analysers Polarized and BayerRGPolarized, as FLIR names them. None for any
/// other. Source: EMVA, "GenICam Pixel Format Naming Convention", 2.1; "Packed": GigE Vision 1.2.
[[nodiscard]] std::optional<PixelFormat> pixel_format_named(std::string_view name);

/// Counts of a picture. A Bayer pattern is interpolated (bilinear, linear in the counts), unless it
/// is one with analysers, whose pixels stay as they are.
/// @param row_padding  bytes after each row.
/// Errors: kBadFormat (fewer bytes than the size asks for; smaller than 2 x 2 with a pattern).
[[nodiscard]] Result<Image<Rgb16>> counts_of(std::span<const std::byte> bytes,
                                             const PixelFormat& format,
                                             int width,
                                             int height,
                                             int row_padding);

}  // namespace veneer::capture
