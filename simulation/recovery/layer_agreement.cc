// SPDX-License-Identifier: Apache-2.0
#include "simulation/recovery/layer_agreement.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/result.h"

namespace veneer::simulation {

namespace {

constexpr float kHalf = 0.5F;  // matter, and opaque, from here on
constexpr double kOpen = 0.1;  // share of the views that must see a point

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  // Precise near 0 too, as the cosine alone is not.
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

LayerAgreement layer_agreement(const btf::LayerStack& stack,
                               const LayerTruth& truth,
                               const btf::DirectionSet& views) {
  const int texels = stack.texel_count();
  const int layers = stack.layer_count();
  VENEER_CHECK(truth.occupancy.size() == static_cast<std::size_t>(texels * layers));
  const auto is_matter = [&](int layer, int texel) {
    return truth.occupancy[static_cast<std::size_t>(layer * texels + texel)] >= kHalf;
  };
  btf::LayerStack opaque(
      stack.width(), stack.height(), {stack.heights().begin(), stack.heights().end()});
  for (int layer = 0; layer < layers; ++layer)
    for (int texel = 0; texel < texels; ++texel)
      if (is_matter(layer, texel)) opaque.set_point(layer, texel, {.transmittance = 0.0F});

  LayerAgreement result;
  int right = 0;
  int matter = 0;
  std::vector<double> off;
  std::vector<double> off_level;
  for (int layer = 0; layer + 1 < layers; ++layer) {
    for (int texel = 0; texel < texels; ++texel) {
      double open = 0.0;
      for (const btf::Direction& view : views) open += opaque.arriving(layer, texel, view);
      if (open < kOpen * static_cast<double>(views.size())) continue;
      const btf::LayerPoint point = stack.point(layer, texel);
      const bool found = point.transmittance < kHalf;
      ++result.judged;
      matter += is_matter(layer, texel);
      right += found == is_matter(layer, texel);
      if (!found || !is_matter(layer, texel)) continue;
      const Eigen::Vector3d normal =
          truth.normals[static_cast<std::size_t>(layer * texels + texel)].cast<double>();
      off.push_back(angle_deg(point.normal.cast<double>(), normal));
      off_level.push_back(angle_deg(Eigen::Vector3d::UnitZ(), normal));
    }
  }
  if (result.judged > 0) {
    result.occupancy = static_cast<double>(right) / result.judged;
    result.occupancy_of_none =
        static_cast<double>(std::max(matter, result.judged - matter)) / result.judged;
  }
  result.compared = static_cast<int>(off.size());
  result.normal_median_deg = median(off);
  result.normal_median_of_level_deg = median(off_level);
  return result;
}

}  // namespace veneer::simulation
