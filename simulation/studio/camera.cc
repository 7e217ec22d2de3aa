// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/camera.h"

#include <fmt/format.h>

#include <cmath>

#include "base/random.h"

namespace veneer::simulation::studio {

namespace {

// Above all that the sensor draws in.
constexpr std::uint64_t kFateStream = std::uint64_t{1} << 62U;

}  // namespace

StudioCamera::StudioCamera(StudioRig& rig) : rig_(rig), sensor_(rig.truth()) {}

std::string StudioCamera::description() const {
  const StudioTruth& truth = rig_.truth();
  return fmt::format("virtual studio camera, {} x {}, {} bits{}, seed {}",
                     truth.width,
                     truth.height,
                     truth.bits,
                     truth.mosaic ? ", polarisation mosaic" : "",
                     truth.seed);
}

Status StudioCamera::set_exposure(double seconds) {
  if (!(seconds >= kLeast_s && seconds <= kMost_s))
    return fail(Errc::kInvalidOption,
                "setting the exposure of the studio's camera: {} s is not between {} and {} s",
                seconds,
                kLeast_s,
                kMost_s);
  exposure_s_ = seconds;
  return {};
}

Status StudioCamera::set_gain_db(double gain) {
  if (!(gain >= 0 && gain <= kMostGain_db))
    return fail(Errc::kInvalidOption,
                "setting the gain of the studio's camera: {} dB is not between 0 and {} dB",
                gain,
                kMostGain_db);
  gain_ = std::pow(10, gain / 20);
  return {};
}

Status StudioCamera::set_trigger(capture::Trigger trigger) {
  if (trigger != capture::Trigger::kHardware) return {};
  return fail(Errc::kUnavailable,
              "setting the trigger of the studio's camera: nothing is wired to it; take \"free\" "
              "or \"software\"");
}

Result<capture::CameraFrame> StudioCamera::grab() {
  const StudioTruth& truth = rig_.truth();
  const Time begin = rig_.clock().now();
  rig_.pass(exposure_s_ + kReadOut_s);
  const double fate = Pcg32(truth.seed, kFateStream + ++grabs_).uniform();
  if (fate < truth.dropped) {
    ++exposed_;
    return fail(Errc::kTimeout,
                "grabbing from the studio's camera: picture {} was lost on its way; grab again",
                exposed_);
  }
  if (fate < truth.dropped + truth.repeated && last_) return *last_;
  capture::CameraFrame frame;
  frame.counts = sensor_.expose(rig_.light(), exposure_s_, gain_, grabs_);
  frame.full_scale = sensor_.full_scale();
  frame.exposure_s = exposure_s_;
  frame.time = begin + from_seconds(0.5 * exposure_s_);
  frame.mosaic = truth.mosaic ? capture::Mosaic::kPolarMono : capture::Mosaic::kNone;
  frame.sequence = ++exposed_;
  if (truth.repeated > 0) last_ = frame;
  return frame;
}

}  // namespace veneer::simulation::studio
