// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/devices.h"

#include <cmath>
#include <string_view>
#include <utility>

#include "base/random.h"

namespace veneer::simulation::studio {
namespace {

// Above all that the sensor draws in.
constexpr std::uint64_t kFateStream = std::uint64_t{1} << 62U;

Status check_index(std::string_view name, int index, int count) {
  if (index >= 0 && index < count) return {};
  return fail(Errc::kInvalidOption,
              "arranging the studio: there is no {} {}; the plan has 0 to {}",
              name,
              index,
              count - 1);
}

Status turn_analyser(StudioRig& rig, double angle_rad, double seconds) {
  if (rig.truth().mosaic)
    return fail(Errc::kUnavailable,
                "turning the studio's analyser: its camera has them on the sensor; do not ask for "
                "angles");
  if (!std::isfinite(angle_rad))
    return fail(Errc::kInvalidOption,
                "turning the studio's analyser: {} is no angle; give radians",
                angle_rad);
  rig.pass(seconds);
  Arrangement arrangement = rig.arrangement();
  arrangement.analyser_rad = angle_rad;
  rig.arrange(arrangement);
  return {};
}

}  // namespace

StudioRig::StudioRig(
    StudioScene scene, const StudioTruth& truth, int views, int lights, bool has_mirror)
    : scene_(std::move(scene)),
      truth_(truth),
      views_(views),
      lights_(lights),
      has_mirror_(has_mirror) {}

const Image<Rgb32f>& StudioRig::light() {
  if (lit_ != arrangement_) {
    light_ = scene_.light(arrangement_);
    lit_ = arrangement_;
  }
  return light_;
}

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

Status StudioHands::please(const capture::HandRequest& request) {
  using Task = capture::HandRequest::Task;
  Arrangement arrangement = rig_.arrangement();
  double seconds = kMove_s;
  switch (request.task) {
    case Task::kPlaceTarget:
      if (request.target == capture::Target::kMirror && !rig_.has_mirror())
        return fail(Errc::kUnavailable,
                    "placing the studio's mirror: the plan says at no light how it stands; give it "
                    "[mirror] light, or ask for none");
      arrangement.target = request.target;
      break;
    case Task::kPlaceView:
      VENEER_TRY(check_index("view", request.index, rig_.views()));
      arrangement.view = request.index;
      break;
    case Task::kPlaceLight:
      VENEER_TRY(check_index("light", request.index, rig_.lights()));
      arrangement.light = request.index;
      break;
    case Task::kDarken:
    case Task::kLight:
      arrangement.dark = request.task == Task::kDarken;
      seconds = kSwitch_s;
      break;
    case Task::kTurnAnalyser:
      return turn_analyser(rig_, request.angle_rad, kMove_s);
  }
  rig_.pass(seconds);
  rig_.arrange(arrangement);
  return {};
}

Status StudioPolariser::turn_to(double angle_rad) {
  return turn_analyser(rig_, angle_rad, kTurn_s);
}

}  // namespace veneer::simulation::studio
