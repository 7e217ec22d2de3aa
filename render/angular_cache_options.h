// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"

namespace veneer::render {

/// Whether and how finely a clustered model's directional part is cached (angular_cache.h). Models
/// that offer no cache are drawn per pixel whatever this says.
struct AngularCacheOptions {
  /// Pixels between nodes, 4 to 128; 0 draws every pixel by itself.
  int spacing = 0;
  /// The most that a direction may turn between neighbouring nodes, as a chord (about radians).
  /// Above 0, to 1. The Bonn data are 0.26 apart.
  double most_turn = 0.1;
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::render
