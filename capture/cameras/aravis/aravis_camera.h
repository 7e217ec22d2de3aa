// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/camera.h"
#include "capture/cameras/cameras.h"

namespace veneer::capture {

/// A GenICam camera over Ethernet or USB3. Keys: name or address (the only camera where both are
/// absent), layout, full_scale, gain_raw, timeout_s, packet_size, packet_delay_us
/// (docs/howto/camera.md).
///
/// The camera's acquisition is started by each grab and stopped after it, so that no picture is
/// older than the call and a new exposure holds for the very next one. A picture's time is the
/// arrival of its first bytes on this machine, less half the exposure, but not before the call plus
/// that half: late by the sensor's readout, some milliseconds, and independent of the camera's own
/// clock. Its number grows with each picture, by more than one where the camera's own did.
class AravisCamera final : public Camera {
 public:
  /// Errors: kNotFound, kUnavailable (another program holds it), kInvalidOption, kDisconnected.
  [[nodiscard]] static Result<std::unique_ptr<AravisCamera>> open(TomlReader& config);
  /// Cameras that answer on every network and USB; waits a second for answers. `identity` is for
  /// the key `name`.
  [[nodiscard]] static Result<std::vector<CameraInfo>> list();
  ~AravisCamera() override;

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] int width() const override;
  [[nodiscard]] int height() const override;
  [[nodiscard]] Status set_exposure(double seconds) override;
  [[nodiscard]] ExposureRange exposure_range() const override;
  [[nodiscard]] Status set_gain_db(double gain) override;
  /// Those of the camera that can be read here.
  [[nodiscard]] std::vector<std::string> pixel_formats() const override;
  [[nodiscard]] Status set_pixel_format(std::string_view name) override;
  [[nodiscard]] Status set_trigger(Trigger trigger) override;
  /// A camera that does not answer for about ten seconds is kDisconnected.
  [[nodiscard]] Result<CameraFrame> grab() override;

 private:
  struct State;
  explicit AravisCamera(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::capture
