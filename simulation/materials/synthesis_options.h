// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/result.h"
#include "btf/direction.h"

namespace veneer::simulation {

struct SynthesisOptions {
  /// Texels along each side, in [1, 512].
  int size = 64;
  /// Where the material is seen from and lit from: unit, above the horizon by at least 0.1 degree.
  btf::DirectionSet views = btf::bonn_directions();
  btf::DirectionSet lights = btf::bonn_directions();
  /// Paths per texel and view, in [1, 65536]; each is connected to every light.
  int samples = 16;
  /// Reflections between the surface's parts that are followed, in [0, 64]; 0 is direct light only.
  int bounces = 2;
  std::uint64_t seed = 1;
  /// Traces every shadow ray in place of the table of shadows (shadow_table.h): several times
  /// slower, sharp to the last digit. For checking.
  bool exact_shadows = false;

  /// Errors: kInvalidOption, naming the field, its value and what it may be.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::simulation
