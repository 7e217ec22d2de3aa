// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/rig.h"

#include <cmath>
#include <utility>

namespace veneer::simulation::studio {

StudioRig::StudioRig(
    StudioScene scene, const StudioTruth& truth, int views, int lights, bool has_mirror)
    : scene_(std::move(scene)),
      truth_(truth),
      views_(views),
      lights_(lights),
      has_mirror_(has_mirror) {}

const Image<Rgb32f>& StudioRig::light() {
  if (lit_ != arrangement_) {
    light_ = scene_.light(arrangement_);
    lit_ = arrangement_;
  }
  return light_;
}

Status StudioRig::turn_analyser(double angle_rad, double seconds) {
  if (truth_.mosaic)
    return fail(Errc::kUnavailable,
                "turning the studio's analyser: its camera has them on the sensor; do not ask for "
                "angles");
  if (!std::isfinite(angle_rad))
    return fail(Errc::kInvalidOption,
                "turning the studio's analyser: {} is no angle; give radians",
                angle_rad);
  pass(seconds);
  arrangement_.analyser_rad = angle_rad;
  return {};
}

}  // namespace veneer::simulation::studio
