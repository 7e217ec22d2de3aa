// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/layer_truth.h"

#include <optional>

#include "base/parallel.h"
#include "simulation/materials/solids.h"

namespace veneer::simulation {

namespace {

constexpr int kPlaces = 8;  // along each side of a texel

// The normal of what a layer has at a place, if anything: grid frame.
std::optional<Eigen::Vector3d> normal_at(
    const Solids& solids, double x, double y, double bottom, double top) {
  const Eigen::Vector3d from(x, y, top);
  if (solids.distance(from) <= 0.0) return solids.normal_above(from);
  const auto hit = solids.first_hit(from * solids.resolution(), -Eigen::Vector3d::UnitZ());
  if (!hit || hit->z < bottom * solids.resolution()) return std::nullopt;
  return solids.normal(*hit);
}

}  // namespace

LayerTruth layer_truth(const BodyField& field, int size, std::span<const double> heights) {
  const Solids solids(field);
  const auto texels = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  LayerTruth truth;
  truth.occupancy.resize(heights.size() * texels);
  truth.normals.resize(heights.size() * texels);
  parallel_for(static_cast<std::int64_t>(texels), 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::size_t layer = 0; layer < heights.size(); ++layer) {
      const double above = layer == 0 ? solids.top() / solids.resolution()
                                      : 0.5 * (heights[layer] + heights[layer - 1]);
      const double below =
          layer + 1 == heights.size() ? 0.0 : 0.5 * (heights[layer] + heights[layer + 1]);
      for (std::int64_t texel = begin; texel < end; ++texel) {
        int matter = 0;
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int i = 0; i < kPlaces * kPlaces; ++i) {
          const double x = (static_cast<double>(texel % size) + (i % kPlaces + 0.5) / kPlaces);
          const double y = (static_cast<double>(texel / size) + (i / kPlaces + 0.5) / kPlaces);
          const auto normal = normal_at(solids, x / size, y / size, below, above);
          if (!normal) continue;
          ++matter;
          sum += *normal;
        }
        const std::size_t at = layer * texels + static_cast<std::size_t>(texel);
        truth.occupancy[at] = static_cast<float>(matter) / (kPlaces * kPlaces);
        truth.normals[at].setZero();
        // Rows grow towards -y.
        if (sum.norm() > 0.0)
          truth.normals[at] =
              Eigen::Vector3d(sum.x(), -sum.y(), sum.z()).normalized().cast<float>();
      }
    }
  });
  return truth;
}

}  // namespace veneer::simulation
