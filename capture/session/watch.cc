// SPDX-License-Identifier: Apache-2.0
#include "capture/session/watch.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/statistics.h"

namespace veneer::capture {

bool Change::light_changed() const {
  constexpr double kSteady = 0.01;  // what the separation is to be good for
  return !(std::abs(light - 1) <= kSteady);
}

Result<Change> change_since(const CameraFrame& first,
                            const CameraFrame& again,
                            const CameraFrame& later) {
  const auto size = [](const CameraFrame& frame) {
    return std::pair(frame.counts.width(), frame.counts.height());
  };
  if (size(first) != size(again) || size(first) != size(later))
    return fail(Errc::kBadFormat, "the camera's pictures change their size");
  const auto pixels = first.counts.pixels().size();
  double sum_first = 0;
  double sum_later = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      sum_first += 0.5 * (first.counts.pixels()[i][c] + again.counts.pixels()[i][c]);
      sum_later += later.counts.pixels()[i][c];
    }
  }
  Change change;
  if (sum_first > 0) change.light = sum_later / sum_first;
  std::vector<double> noise;
  std::vector<double> differences;
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double a = first.counts.pixels()[i][c];
      const double b = again.counts.pixels()[i][c];
      const double z = later.counts.pixels()[i][c];
      if (std::max({a, b, z}) >= first.full_scale) continue;  // says nothing
      noise.push_back(std::abs(b - a));
      differences.push_back(std::abs(z - change.light * a));
    }
  }
  // Most of a picture may be plain, where movement changes nothing: what counts is its edges.
  constexpr double kEdges = 0.95;
  // The least that noise can be taken for: a step of the counts.
  const double expected = std::max(quantile(std::move(noise), kEdges), 1.0);
  const double found = quantile(std::move(differences), kEdges);
  change.movement = found / expected;
  return change;
}

}  // namespace veneer::capture
