// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/tone_table.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

#include "calibration/colour/ramps.h"
#include "calibration/interpolation.h"

namespace veneer::calibration {

Eigen::Vector3d ToneTable::drive_of(const Eigen::Vector3d& linear) const {
  Eigen::Vector3d drive;
  for (Eigen::Index c = 0; c < 3; ++c) {
    const std::vector<double>& curve = curves[static_cast<std::size_t>(c)];
    const double wanted = std::clamp(linear[c], 0.0, 1.0);
    // The first that is not less; the curve's last value is 1, so there is one.
    const auto found = std::ranges::lower_bound(curve, wanted);
    const auto i = found - curve.begin();
    const double last = static_cast<double>(curve.size() - 1);
    if (i == 0) {
      drive[c] = 0.0;
    } else {
      const double below = *(found - 1);
      drive[c] = (static_cast<double>(i - 1) + (wanted - below) / (*found - below)) / last;
    }
  }
  return drive;
}

Result<ToneTable> tone_table(const ColourModel& model, int size) {
  VENEER_CHECK(size >= 2);
  ToneTable table;
  for (Eigen::Index c = 0; c < 3; ++c)
    table.primaries.col(c) = model.forward(Eigen::Vector3d::Unit(c));
  if (!table.primaries.allFinite() || !are_independent(table.primaries))
    return fail(Errc::kBadFormat,
                "tabulating {}: its primaries do not span all colours; measure again",
                model.name());
  table.linear_from_xyz = table.primaries.inverse();
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::vector<double> curve;
    curve.reserve(static_cast<std::size_t>(size));
    for (int i = 0; i < size; ++i) {
      const double drive = i / (size - 1.0);
      const double value =
          table.linear_from_xyz.row(c) * model.forward(drive * Eigen::Vector3d::Unit(c));
      if (!std::isfinite(value))
        return fail(Errc::kBadFormat,
                    "tabulating {}: it is not finite at drive {:.4f}; measure again",
                    model.name(),
                    drive);
      curve.push_back(std::clamp(value, 0.0, 1.0));
    }
    curve = nearest_rising(curve);
    curve.front() = 0.0;
    curve.back() = 1.0;
    table.curves[static_cast<std::size_t>(c)] = std::move(curve);
  }
  return table;
}

}  // namespace veneer::calibration
