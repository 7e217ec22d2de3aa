// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/baking.h"

#include <utility>

#include "calibration/colour/tone_table.h"

namespace veneer::calibration {
namespace {

/// What tone curves and matrix may miss of a model before it counts as drift: rounding, in parts of
/// full output. Noise is a million times more.
constexpr double kRounding = 1e-9;

bool keeps_chromaticity(const ColourModel& model, const ToneTable& table) {
  for (Eigen::Index c = 0; c < 3; ++c) {
    const std::vector<double>& curve = table.curves[static_cast<std::size_t>(c)];
    const double last = static_cast<double>(curve.size() - 1);
    for (std::size_t i = 0; i < curve.size(); ++i) {
      const Eigen::Vector3d drive = static_cast<double>(i) / last * Eigen::Vector3d::Unit(c);
      const Eigen::Vector3d linear = table.linear_from_xyz * model.forward(drive);
      if ((linear - curve[i] * Eigen::Vector3d::Unit(c)).cwiseAbs().maxCoeff() > kRounding)
        return false;
    }
  }
  return true;
}

}  // namespace

Result<BakedColour> bake(const ColourModel& model, int bits) {
  if (bits < 1 || bits > 16)
    return fail(
        Errc::kInvalidOption, "tabulating {}: {} bits; it must be 1 to 16", model.name(), bits);
  VENEER_ASSIGN(ToneTable table, tone_table(model, 1 << bits));
  BakedColour baked;
  baked.primaries = table.primaries;
  if (!model.is_additive() || !keeps_chromaticity(model, table)) {
    baked.residual = ColourResidual::sampled(
        kResidualNodes, [&](const Eigen::Vector3d& linear) -> Eigen::Vector3d {
          return table.linear_from_xyz * model.forward(table.drive_of(linear)) - linear;
        });
  }
  baked.tone_curves = std::move(table.curves);
  return baked;
}

}  // namespace veneer::calibration
