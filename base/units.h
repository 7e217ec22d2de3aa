// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <numbers>

namespace veneer {

/// A number with a unit in its type, for public scalars. Inner loops use raw doubles whose names
/// carry the unit as a suffix (_rad, _m, _nits).
template <class Unit>
struct Quantity {
  double value{};
  constexpr auto operator<=>(const Quantity&) const = default;
};

using Radians = Quantity<struct Radian>;
using Degrees = Quantity<struct Degree>;
using Metres = Quantity<struct Metre>;
/// Luminance, cd/m^2.
using Nits = Quantity<struct CandelaPerSquareMetre>;
/// Illuminance, lm/m^2.
using Lux = Quantity<struct LumenPerSquareMetre>;

[[nodiscard]] constexpr Radians to_radians(Degrees angle) {
  return {angle.value * std::numbers::pi / 180.0};
}
[[nodiscard]] constexpr Degrees to_degrees(Radians angle) {
  return {angle.value * 180.0 / std::numbers::pi};
}

}  // namespace veneer
