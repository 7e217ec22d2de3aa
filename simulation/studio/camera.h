// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/result.h"
#include "capture/camera.h"
#include "simulation/studio/rig.h"
#include "simulation/studio/sensor.h"

namespace veneer::simulation::studio {

/// The camera of a rig. A grab takes its exposure and the time to read it out. Every grab draws
/// noise of its own.
class StudioCamera final : public capture::Camera {
 public:
  static constexpr double kLeast_s = 1e-5;
  static constexpr double kMost_s = 10;
  static constexpr double kMostGain_db = 24;
  static constexpr double kReadOut_s = 0.02;

  /// @param rig  borrowed; must outlive the camera.
  explicit StudioCamera(StudioRig& rig);
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] int width() const override { return rig_.truth().width; }
  [[nodiscard]] int height() const override { return rig_.truth().height; }
  [[nodiscard]] Status set_exposure(double seconds) override;
  [[nodiscard]] capture::ExposureRange exposure_range() const override {
    return {kLeast_s, kMost_s};
  }
  [[nodiscard]] Status set_gain_db(double gain) override;
  [[nodiscard]] Status set_trigger(capture::Trigger trigger) override;
  [[nodiscard]] Result<capture::CameraFrame> grab() override;

 private:
  StudioRig& rig_;
  StudioSensor sensor_;
  double exposure_s_ = 0.05;
  double gain_ = 1;
  std::uint64_t grabs_ = 0;
  std::uint64_t exposed_ = 0;  // pictures, lost ones too
  std::optional<capture::CameraFrame> last_;
};

}  // namespace veneer::simulation::studio
