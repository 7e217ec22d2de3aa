// SPDX-License-Identifier: Apache-2.0
#include "render/luminance_ceiling.h"

namespace veneer::render {

LuminanceCeiling::LuminanceCeiling(const calibration::ProjectorProfile& profile, double nits)
    : nits_(nits) {
  if (!active()) return;
  tone_curves_ = profile.tone_curves;
  residual_ = profile.residual;
  primaries_nits_ = profile.primaries.row(1);
  black_nits_ = profile.black.y();
}

double LuminanceCeiling::luminance(const std::array<std::uint16_t, 3>& codes) const {
  const Eigen::Vector3d t(
      tone_curves_[0][codes[0]], tone_curves_[1][codes[1]], tone_curves_[2][codes[2]]);
  return primaries_nits_.dot(t + residual_(t)) + black_nits_;
}

}  // namespace veneer::render
