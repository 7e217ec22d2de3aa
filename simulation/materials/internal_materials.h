// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "simulation/materials/body_field.h"
#include "simulation/materials/height_field.h"

namespace veneer::simulation {

[[nodiscard]] BodyField make_bars(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_cloth(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_corrugated(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_corrugated_print(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_hammered(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_leather(int size, std::uint64_t seed);
[[nodiscard]] BodyField make_lichen(int size, std::uint64_t seed);
[[nodiscard]] HeightField make_plaster(int size, std::uint64_t seed);

/// Samples a material given as functions of the place (x, y) in tile widths, y downwards.
/// @param height_at  double(x, y), tile widths; asked at the cells' corners
/// @param surface_at  Surface(x, y); asked at their middles
template <class HeightAt, class SurfaceAt>
[[nodiscard]] HeightField sampled_field(int resolution,
                                        double tile_width_mm,
                                        const HeightAt& height_at,
                                        const SurfaceAt& surface_at) {
  HeightField field;
  field.resolution = resolution;
  field.tile_width_mm = tile_width_mm;
  const auto cells = static_cast<std::size_t>(resolution) * static_cast<std::size_t>(resolution);
  field.heights.reserve(cells);
  field.surfaces.reserve(cells);
  for (int row = 0; row < resolution; ++row) {
    for (int column = 0; column < resolution; ++column) {
      const double x = static_cast<double>(column) / resolution;
      const double y = static_cast<double>(row) / resolution;
      const double half = 0.5 / resolution;
      field.heights.push_back(static_cast<float>(height_at(x, y)));
      field.surfaces.push_back(surface_at(x + half, y + half));
    }
  }
  return field;
}

}  // namespace veneer::simulation
