// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "simulation/materials/body_field.h"

namespace veneer::simulation {

/// One line of the registry of synthetic materials made of bodies.
struct BodyMaterial {
  std::string_view name;
  std::string_view summary;
  /// A tile that repeats without a seam and is the same at every size.
  /// @param size  texels along each side of the set, > 0
  BodyField (*make)(int size, std::uint64_t seed);
  /// Where most of it lies, from the top down to the ground, tile widths: heights at which
  /// layers tell it best.
  std::span<const double> heights;
};

/// In equal steps, as fits of layers have them.
inline constexpr std::array kBarHeights{0.10, 0.05, 0.0};
inline constexpr std::array kLichenHeights{0.12, 0.06, 0.0};

/// Every one, sorted by name.
[[nodiscard]] std::span<const BodyMaterial> body_materials();
/// Null where there is none of the name.
[[nodiscard]] const BodyMaterial* find_body_material(std::string_view name);

}  // namespace veneer::simulation
