// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "capture/camera.h"
#include "capture/hands.h"
#include "capture/polariser.h"
#include "simulation/studio/scene.h"
#include "simulation/studio/sensor.h"

namespace veneer::simulation::studio {

/// A studio's rig: what stands how, what the camera gets, what time it is.
class StudioRig {
 public:
  StudioRig(StudioScene scene, const StudioTruth& truth, int views, int lights, bool has_mirror);

  [[nodiscard]] const Arrangement& arrangement() const { return arrangement_; }
  void arrange(const Arrangement& arrangement) { arrangement_ = arrangement; }
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

class StudioPolariser final : public capture::Polariser {
 public:
  static constexpr double kTurn_s = 1;
  /// @param rig  borrowed; must outlive the polariser.
  explicit StudioPolariser(StudioRig& rig) : rig_(rig) {}
  [[nodiscard]] std::string description() const override { return "the studio's analyser"; }
  [[nodiscard]] Status turn_to(double angle_rad) override;

 private:
  StudioRig& rig_;
};

}  // namespace veneer::simulation::studio
