// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "simulation/materials/light_array.h"
#include "simulation/materials/relief.h"

namespace veneer::simulation {

/// Which lights reach which cell of a relief, so that a point asks for all its shadows at once.
///
/// One ray from the middle of every cell to every light; between the middles the answer is
/// bilinear. A shadow's edge is therefore about one cell (a quarter of a texel) soft and off by at
/// most half a cell; nothing else is approximated. A cell that faces away from a light says what
/// its neighbours that face it say, so that a ridge stays bright up to its edge.
class ShadowTable {
 public:
  /// Traces resolution^2 * lights rays in parallel; one step of progress per row.
  ShadowTable(const Relief& relief, const LightArray& lights, Progress& progress);
  /// @param out  lights.padded() values in [0, 1]: the share of each light that reaches the point.
  void look_up(const Relief::Hit& hit, std::span<float> out) const;

 private:
  [[nodiscard]] const std::uint8_t* cell(int column, int row) const;
  int resolution_;
  std::size_t lights_;             // padded
  std::vector<std::uint8_t> lit_;  // [row][column][light], 0 to 255
};

}  // namespace veneer::simulation
