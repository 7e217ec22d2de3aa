// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/layer_truth.h"

#include "base/parallel.h"
#include "simulation/materials/solids.h"

namespace veneer::simulation {

namespace {

constexpr int kPlaces = 8;  // along each side of a texel

}  // namespace

LayerTruth layer_truth(const BodyField& field, int size, std::span<const double> heights) {
  const Solids solids(field);
  const auto texels = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  LayerTruth truth;
  truth.occupancy.resize(heights.size() * texels);
  truth.normals.resize(heights.size() * texels);
  parallel_for(static_cast<std::int64_t>(texels), 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::size_t layer = 0; layer < heights.size(); ++layer) {
      for (std::int64_t texel = begin; texel < end; ++texel) {
        int matter = 0;
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int i = 0; i < kPlaces * kPlaces; ++i) {
          const Eigen::Vector3d place(
              (static_cast<double>(texel % size) + (i % kPlaces + 0.5) / kPlaces) / size,
              (static_cast<double>(texel / size) + (i / kPlaces + 0.5) / kPlaces) / size,
              heights[layer]);
          if (solids.distance(place) > 0.0) continue;
          ++matter;
          sum += solids.normal_above(place);
        }
        const std::size_t at = layer * texels + static_cast<std::size_t>(texel);
        truth.occupancy[at] = static_cast<float>(matter) / (kPlaces * kPlaces);
        if (sum.norm() > 0.0) {
          sum.normalize();
          // Rows grow towards -y.
          truth.normals[at] = Eigen::Vector3d(sum.x(), -sum.y(), sum.z()).cast<float>();
        } else {
          truth.normals[at].setZero();
        }
      }
    }
  });
  return truth;
}

}  // namespace veneer::simulation
