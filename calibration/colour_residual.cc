// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour_residual.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/result.h"

namespace veneer::calibration {
namespace {

std::size_t node_count(int nodes) {
  const auto n = static_cast<std::size_t>(nodes);
  return n * n * n;
}

}  // namespace

ColourResidual::ColourResidual(int nodes, std::vector<Eigen::Vector3d> values)
    : nodes_(nodes), values_(std::move(values)) {
  VENEER_CHECK(nodes >= 2 && nodes <= 129 && values_.size() == node_count(nodes));
  VENEER_CHECK(std::ranges::all_of(values_, [](const auto& value) { return value.allFinite(); }));
}

ColourResidual ColourResidual::sampled(
    int nodes, const std::function<Eigen::Vector3d(const Eigen::Vector3d& drive)>& rho) {
  const auto drive_at = [nodes](int i) {
    const double root = i / (nodes - 1.0);
    return root * root;
  };
  std::vector<Eigen::Vector3d> values;
  values.reserve(node_count(nodes));
  for (int b = 0; b < nodes; ++b) {
    for (int g = 0; g < nodes; ++g) {
      for (int r = 0; r < nodes; ++r)
        values.push_back(rho({drive_at(r), drive_at(g), drive_at(b)}));
    }
  }
  return {nodes, std::move(values)};
}

Eigen::Vector3d ColourResidual::operator()(const Eigen::Vector3d& drive) const {
  if (empty()) return Eigen::Vector3d::Zero();
  if (drive.hasNaN()) return Eigen::Vector3d::Constant(std::nan(""));
  std::array<double, 3> part{};
  std::array<std::size_t, 3> step{1, static_cast<std::size_t>(nodes_), 0};
  step[2] = step[1] * step[1];
  std::size_t node = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double at =
        std::sqrt(std::clamp(drive[static_cast<Eigen::Index>(c)], 0.0, 1.0)) * (nodes_ - 1);
    const int cell = std::min(static_cast<int>(at), nodes_ - 2);
    part[c] = at - cell;
    node += static_cast<std::size_t>(cell) * step[c];
  }
  // From the cell's lowest corner to its highest, along the axis with the largest part first.
  std::array<std::size_t, 3> order{0, 1, 2};
  std::ranges::sort(order, [&part](std::size_t a, std::size_t b) { return part[a] > part[b]; });
  Eigen::Vector3d value = (1.0 - part[order[0]]) * values_[node];
  for (std::size_t i = 0; i < 3; ++i) {
    node += step[order[i]];
    const double next = i < 2 ? part[order[i + 1]] : 0.0;
    value += (part[order[i]] - next) * values_[node];
  }
  return value;
}

}  // namespace veneer::calibration
