// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/sample_set.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {

/// The full BTF, interpolated linearly between measured directions in double precision: what every
/// model is compared with. Thread-safe.
class InterpolatedSet {
 public:
  explicit InterpolatedSet(SampleSet set);
  /// RGB in the sample's unit (SampleSetInfo). @param texel  row * width + column.
  [[nodiscard]] Eigen::Vector3d radiance(int texel,
                                         const Direction& view,
                                         const Direction& light) const;
  /// The weights of a pair of directions, for many texels.
  struct PairWeights {
    DirectionWeights view;
    DirectionWeights light;
  };
  [[nodiscard]] PairWeights weights(const Direction& view, const Direction& light) const;
  [[nodiscard]] Eigen::Vector3d radiance(int texel, const PairWeights& weights) const;
  [[nodiscard]] const SampleSet& set() const { return set_; }

 private:
  SampleSet set_;
  SphericalInterpolator views_;
  SphericalInterpolator lights_;
};

}  // namespace veneer::btf
