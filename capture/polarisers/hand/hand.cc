// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/hand/hand.h"

#include <numbers>

namespace veneer::capture {
namespace {

class HandPolariser final : public Polariser {
 public:
  explicit HandPolariser(Hands& hands) : hands_(hands) {}

  [[nodiscard]] std::string description() const override { return "turned by hand"; }
  [[nodiscard]] Status turn_to(double angle_rad) override {
    HandRequest request;
    request.task = HandRequest::Task::kTurnAnalyser;
    request.angle_rad = angle_rad;
    request.text = fmt::format(
        "Turn the polariser before the camera to {:.4g} degrees (0 is parallel to the "
        "projector's, 90 is crossed).",
        angle_rad * 180 / std::numbers::pi);
    return hands_.please(request);
  }

 private:
  Hands& hands_;
};

}  // namespace

Result<std::unique_ptr<Polariser>> open_hand_polariser(TomlReader& /*config*/, Hands& hands) {
  return std::make_unique<HandPolariser>(hands);
}

}  // namespace veneer::capture
