// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <vector>

#include "btf/direction.h"
#include "simulation/materials/geometry.h"

namespace veneer::simulation {

/// Light directions in the grid frame, one array per coordinate so that loops over them become
/// vector code. Padded to whole vectors with lights from straight below, which light nothing.
struct LightArray {
  std::vector<float> x, y, z;
  std::size_t count = 0;  ///< without padding

  explicit LightArray(const btf::DirectionSet& lights) : count(lights.size()) {
    constexpr std::size_t kVector = 16;
    const std::size_t padded = (count + kVector - 1) / kVector * kVector;
    x.assign(padded, 0.0F);
    y.assign(padded, 0.0F);
    z.assign(padded, -1.0F);
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3f light = grid_from_local(lights[i]).cast<float>();
      x[i] = light.x();
      y[i] = light.y();
      z[i] = light.z();
    }
  }
  [[nodiscard]] std::size_t padded() const { return x.size(); }
  [[nodiscard]] Eigen::Vector3d direction(std::size_t i) const {
    return Eigen::Vector3f(x[i], y[i], z[i]).cast<double>();
  }
};

}  // namespace veneer::simulation
