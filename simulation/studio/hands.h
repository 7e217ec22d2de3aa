// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/result.h"
#include "capture/hands.h"
#include "simulation/studio/rig.h"

namespace veneer::simulation::studio {

/// Does at once, on the rig's clock, what it is asked for.
class StudioHands final : public capture::Hands {
 public:
  static constexpr double kMove_s = 20;   ///< a person moves something
  static constexpr double kSwitch_s = 1;  ///< the projector's picture changes
  /// @param rig  borrowed; must outlive the hands.
  explicit StudioHands(StudioRig& rig) : rig_(rig) {}
  [[nodiscard]] Status please(const capture::HandRequest& request) override;
  /// There is nobody to be told.
  void say(std::string_view /*text*/) override {}

 private:
  StudioRig& rig_;
};

}  // namespace veneer::simulation::studio
