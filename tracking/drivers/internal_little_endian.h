// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace veneer::tracking {

/// The signed 16-bit number at `at`, low byte first.
[[nodiscard]] inline std::int16_t int16_at(std::span<const std::byte> bytes, std::size_t at) {
  const auto low = std::to_integer<std::uint16_t>(bytes[at]);
  const auto high = std::to_integer<std::uint16_t>(bytes[at + 1]);
  return static_cast<std::int16_t>(low | (high << 8U));
}

}  // namespace veneer::tracking
