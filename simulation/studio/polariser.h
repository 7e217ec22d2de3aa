// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/result.h"
#include "capture/polariser.h"
#include "simulation/studio/rig.h"

namespace veneer::simulation::studio {

/// The analyser of a rig, on a stage.
class StudioPolariser final : public capture::Polariser {
 public:
  static constexpr double kTurn_s = 1;
  /// @param rig  borrowed; must outlive the polariser.
  explicit StudioPolariser(StudioRig& rig) : rig_(rig) {}
  [[nodiscard]] std::string description() const override { return "the studio's analyser"; }
  [[nodiscard]] Status turn_to(double angle_rad) override {
    return rig_.turn_analyser(angle_rad, kTurn_s);
  }

 private:
  StudioRig& rig_;
};

}  // namespace veneer::simulation::studio
