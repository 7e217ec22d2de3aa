// SPDX-License-Identifier: Apache-2.0
#include "btf/interpolated_set.h"

#include <utility>

namespace veneer::btf {

InterpolatedSet::InterpolatedSet(SampleSet set)
    : set_(std::move(set)),
      views_(set_.info().views, DirectionRole::kView),
      lights_(set_.info().lights, DirectionRole::kLight) {}

Eigen::Vector3d InterpolatedSet::radiance(int texel,
                                          const Direction& view,
                                          const Direction& light) const {
  return radiance(texel, weights(view, light));
}

InterpolatedSet::PairWeights InterpolatedSet::weights(const Direction& view,
                                                      const Direction& light) const {
  return {views_.weights(view), lights_.weights(light)};
}

Eigen::Vector3d InterpolatedSet::radiance(int texel, const PairWeights& weights) const {
  const SampleSetInfo& info = set_.info();
  const std::span<const Eigen::half> samples = set_.stored(texel);
  const DirectionWeights& v = weights.view;
  const DirectionWeights& l = weights.light;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const double weight = v.weight[i] * l.weight[j];
      if (weight == 0.0) continue;
      const std::size_t pair = static_cast<std::size_t>(v.index[i]) * info.lights.size() +
                               static_cast<std::size_t>(l.index[j]);
      const Eigen::half* sample = &samples[pair * static_cast<std::size_t>(info.channel_count())];
      const Eigen::Map<const Eigen::Vector3<Eigen::half>> first(sample);
      sum += weight * first.cast<double>();
      if (info.polarised)
        sum += weight * Eigen::Map<const Eigen::Vector3<Eigen::half>>(sample + 3).cast<double>();
    }
  }
  return v.scale * l.scale * sum;
}

}  // namespace veneer::btf
