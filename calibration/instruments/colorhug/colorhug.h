// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "calibration/instruments/colorhug/colorhug_protocol.h"
#include "calibration/instruments/colorimeter.h"
#include "tracking/device/transport.h"
#include "tracking/transports/bus_device.h"

namespace veneer::calibration {

struct ColorHugOptions {
  tracking::UsbIdentity identity;  ///< which one, where there are several
  /// Stored in the device: 0 factory, up to 63 explicit, 64 LCD, 65 CRT, 66 projector, 67 LED.
  int calibration = colorhug::kCalibrationProjector;
  /// Applied by us to what it reads, see read_ccmx().
  Eigen::Matrix3d corrected_from_read = Eigen::Matrix3d::Identity();
  /// For one reading; dark ones take seconds.
  Duration time_limit = std::chrono::seconds(10);
  [[nodiscard]] Status check() const;
};

/// A ColorHug2 over HID. The ColorHug of the first generation needs other commands: `spotread`
/// reads it.
class ColorHug final : public Colorimeter {
 public:
  /// @param clock  borrowed; must outlive it.
  /// Errors: kNotFound (it is not there), kUnavailable (it may not be opened, runs its boot loader,
  /// or is of the first generation; says the remedy), kInvalidOption, kTimeout, kDisconnected.
  [[nodiscard]] static Result<std::unique_ptr<ColorHug>> open(const ColorHugOptions& options,
                                                              Clock& clock);
  [[nodiscard]] std::string description() const override;
  /// Errors: kTimeout (try again), kDisconnected (final: open again), kBadFormat (the device
  /// complains, or its reply makes no sense).
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;

 private:
  ColorHug(const ColorHugOptions& options,
           std::unique_ptr<tracking::Transport> transport,
           Clock& clock);
  [[nodiscard]] Result<colorhug::Report> exchange(const colorhug::Report& request);
  [[nodiscard]] Result<colorhug::Report> wait_for_reply(colorhug::Command command);

  ColorHugOptions options_;
  std::unique_ptr<tracking::Transport> transport_;
  Clock& clock_;
  std::string name_;
  bool owes_a_reply_ = false;  // of a request that was given up
};

}  // namespace veneer::calibration
