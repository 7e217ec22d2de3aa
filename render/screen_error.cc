// SPDX-License-Identifier: Apache-2.0
#include "render/screen_error.h"

#include <algorithm>
#include <cmath>

#include "base/colour.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr double kEncodingExponent = 1.0 / 2.2;  // of the literature's tables

double encode(double linear) { return std::pow(std::clamp(linear, 0.0, 1.0), kEncodingExponent); }

}  // namespace

double ScreenError::rmse() const {
  return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
}

void add_error(std::span<const Eigen::Vector4f> target,
               std::span<const ScreenQuery> queries,
               std::span<const Vector3d> reference,
               ScreenError& error) {
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  for (std::size_t i = 0; i < queries.size(); ++i) {
    Vector3d white = Vector3d::Zero();
    for (const ScreenQuery::Arriving& light : queries[i].lights) white += light.rgb;
    const Vector3d drawn =
        rgb_from_xyz * target[static_cast<std::size_t>(queries[i].pixel)].head<3>().cast<double>();
    for (int c = 0; c < 3; ++c) {
      const double difference = encode(drawn[c] / white[c]) - encode(reference[i][c] / white[c]);
      error.sum += std::abs(difference);
      error.squares += difference * difference;
    }
    error.count += 3;
  }
}

}  // namespace veneer::render
