// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "capture/recording.h"
#include "capture/session/session.h"

namespace veneer::capture {

/// The devices of a session and what state they are in, so that nothing is asked for twice.
class Rig {
 public:
  /// @param plan, devices  borrowed.
  Rig(const CapturePlan& plan, const CaptureDevices& devices) : plan_(plan), devices_(devices) {}

  /// Errors of all: those of Hands, Polariser.
  [[nodiscard]] Status place(Target target, int view, int light);
  [[nodiscard]] Status lit(bool on);
  /// @param analyser  index into the plan's angles.
  [[nodiscard]] Status turn_to(int analyser);
  /// Where the analyser is; nothing before the first turn.
  [[nodiscard]] std::optional<int> analyser() const { return analyser_; }

  /// One frame. A repeated one is dropped; what went wrong and may go right is tried again a few
  /// times. Errors: those of Camera.
  [[nodiscard]] Result<CameraFrame> grab(double exposure_s);
  /// The mean of the plan's number of frames; shot is not filled in. Errors: of grab(), kBadFormat
  /// (the camera changes its format).
  [[nodiscard]] Result<Picture> picture(double exposure_s);

 private:
  const CapturePlan& plan_;
  const CaptureDevices& devices_;
  std::optional<Target> target_;
  std::optional<int> view_, light_, analyser_;
  std::optional<bool> lit_;
  std::uint64_t last_sequence_ = 0;
};

}  // namespace veneer::capture
