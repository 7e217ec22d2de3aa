// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ostream>
#include <vector>

#include "btf/material.h"
#include "btf/sample_set.h"

namespace veneer::stability {

/// What must happen.
enum class Must {
  kHold,    ///< the measured samples come back to the storage's rounding
  kBound,   ///< values are finite, none over a few times the largest sample
  kBeZero,  ///< zero everywhere, exactly
  kRefuse,  ///< with a text
};

/// A sample set or an option at the edge of what there can be.
struct Extreme {
  const char* name;  ///< of the test
  Must must;
  /// Value of the diffuse part; the specular part is 0.
  double (*sample)(const btf::SampleSetInfo& info, int texel, int view, int light, int channel);
  void (*shape)(btf::SampleSetInfo& info) = [](btf::SampleSetInfo&) {};
  void (*choose)(btf::FitOptions& options, int terms) = [](btf::FitOptions&, int) {};
  /// For kRefuse: words of the message.
  std::vector<const char*> words = {};
  /// Refused by models other than texel-colours only.
  bool for_texel_colours = false;
  /// Whether only models of components hold it; formulas are then bounded.
  bool components_hold = false;
  /// Beside the storage's own: what float16 leaves of the samples, of the largest.
  double more_error = 0.0;
};
void PrintTo(const Extreme& extreme, std::ostream* out);

[[nodiscard]] std::vector<Extreme> extremes();

/// Whether it is matte and its texels differ in hue, not in brightness alone.
[[nodiscard]] bool has_own_hues(const Extreme& extreme);

}  // namespace veneer::stability
