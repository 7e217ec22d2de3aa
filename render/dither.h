// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace veneer::render {

/// The dither threshold of a pixel and channel, in (0, 1): a drive that lies the fraction p of the
/// way between two code values takes the upper one where p is above the threshold.
///
/// theta = frac(x a1 + y a2 + seed g + channel / 3), in exact 32-bit arithmetic, with a1 = 1/rho
/// and a2 = 1/rho^2 for the plastic number rho = 1.3247 and g the golden ratio's fraction: a rank-1
/// lattice. Over any patch its values are spread more evenly than random ones, so that the patch's
/// mean is soon the target; over all pixels or all seeds they are uniform, so that it is exact but
/// for the 24 bits kept. The channels are a third apart, so that not all three step up together.
/// Sources: Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences" (the
/// constants); Cranley and Patterson 1976 (shifting a lattice by a constant keeps it uniform).
[[nodiscard]] constexpr float dither_threshold(std::uint32_t x,
                                               std::uint32_t y,
                                               std::uint32_t channel,
                                               std::uint32_t seed) {
  const std::uint32_t u =
      x * 0xC13FA9A9U + y * 0x91E10DA5U + seed * 0x9E3779B9U + channel * 0x55555555U;
  return (static_cast<float>(u >> 8U) + 0.5F) * 0x1p-24F;
}

}  // namespace veneer::render
