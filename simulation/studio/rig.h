// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/clock.h"
#include "base/image.h"
#include "base/result.h"
#include "simulation/studio/scene.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation::studio {

/// A studio's rig: what stands how, what the camera gets, what time it is.
class StudioRig {
 public:
  StudioRig(StudioScene scene, const StudioTruth& truth, int views, int lights, bool has_mirror);

  [[nodiscard]] const Arrangement& arrangement() const { return arrangement_; }
  void arrange(const Arrangement& arrangement) { arrangement_ = arrangement; }
  /// Takes `seconds`. Errors: kInvalidOption (no angle), kUnavailable (a mosaic).
  [[nodiscard]] Status turn_analyser(double angle_rad, double seconds);
  /// Of every pixel, without noise.
  [[nodiscard]] const Image<Rgb32f>& light();
  [[nodiscard]] StudioScene& scene() { return scene_; }
  [[nodiscard]] const StudioTruth& truth() const { return truth_; }
  [[nodiscard]] VirtualClock& clock() { return clock_; }
  void pass(double seconds) { clock_.sleep_until(clock_.now() + from_seconds(seconds)); }
  [[nodiscard]] int views() const { return views_; }
  [[nodiscard]] int lights() const { return lights_; }
  [[nodiscard]] bool has_mirror() const { return has_mirror_; }

 private:
  StudioScene scene_;
  StudioTruth truth_;
  int views_;
  int lights_;
  bool has_mirror_;
  VirtualClock clock_;
  Arrangement arrangement_;
  std::optional<Arrangement> lit_;  // that light_ is of
  Image<Rgb32f> light_;
};

}  // namespace veneer::simulation::studio
