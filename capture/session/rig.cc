// SPDX-License-Identifier: Apache-2.0
#include "capture/session/rig.h"

#include <algorithm>
#include <numbers>

namespace veneer::capture {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr int kTries = 6;

std::string in_words(const btf::Direction& direction) {
  const btf::Angles angles = btf::angles_from_direction(direction);
  return fmt::format(
      "theta {:.4g}, phi {:.4g} degrees", angles.theta * kDegrees, angles.phi * kDegrees);
}

std::string_view what_to_place(Target target) {
  switch (target) {
    case Target::kWhite:
      return "Put the white target in the sample's place.";
    case Target::kMirror:
      return "Put the mirror in the sample's place and turn it so that it sends the light into the "
             "camera.";
    case Target::kMirrorBall:
      return "Put the mirror ball in the sample's place.";
    case Target::kSample:
      break;
  }
  return "Put the sample on its board.";
}

}  // namespace

Status Rig::place(Target target, int view, int light) {
  using Task = HandRequest::Task;
  if (target_ != target) {
    // Who changes it may have touched anything.
    VENEER_TRY(devices_.hands->please(
        {Task::kPlaceTarget, target, 0, 0, std::string(what_to_place(target))}));
    target_ = target;
  }
  if (view_ != view) {
    VENEER_TRY(devices_.hands->please(
        {Task::kPlaceView,
         target,
         view,
         0,
         fmt::format("Bring the camera to view {} ({}).",
                     view,
                     in_words(plan_.views[static_cast<std::size_t>(view)]))}));
    view_ = view;
  }
  if (light_ != light) {
    VENEER_TRY(devices_.hands->please(
        {Task::kPlaceLight,
         target,
         light,
         0,
         fmt::format("Bring the light to position {} ({}).",
                     light,
                     in_words(plan_.lights[static_cast<std::size_t>(light)]))}));
    light_ = light;
  }
  return {};
}

Status Rig::lit(bool on) {
  if (lit_ == on) return {};
  HandRequest request;
  request.task = on ? HandRequest::Task::kLight : HandRequest::Task::kDarken;
  request.target = target_.value_or(Target::kSample);
  request.text = on ? "Let the projector shine fully on it." : "Cover the projector's lens.";
  VENEER_TRY(devices_.hands->please(request));
  lit_ = on;
  return {};
}

Status Rig::turn_to(int analyser) {
  if (devices_.polariser == nullptr || analyser_ == analyser) return {};
  analyser_.reset();  // wherever it stops, if it does not get there
  VENEER_TRY(devices_.polariser->turn_to(
      plan_.polarisation.analyser_rad[static_cast<std::size_t>(analyser)]));
  analyser_ = analyser;
  return {};
}

Result<CameraFrame> Rig::grab(double exposure_s) {
  VENEER_TRY(devices_.camera->set_exposure(exposure_s));
  Error last{Errc::kTimeout, "it gives the same picture again and again"};
  for (int tried = 0; tried < kTries; ++tried) {
    auto frame = devices_.camera->grab();
    if (!frame) {
      last = frame.error();
      if (last.code != Errc::kTimeout && last.code != Errc::kBadFormat) break;
      continue;
    }
    if (frame->counts.empty() || frame->full_scale == 0) {
      last = {Errc::kBadFormat, "an empty picture"};
      continue;
    }
    // 0 where the camera has no numbers.
    if (frame->sequence != 0 && frame->sequence == last_sequence_) continue;
    last_sequence_ = frame->sequence;
    return frame;
  }
  return fail_while(devices_.camera->description(), last);
}

Result<Picture> Rig::picture(double exposure_s) {
  Picture picture;
  std::vector<Eigen::Array3d> sums;
  std::vector<std::array<bool, 3>> full;
  for (int n = 0; n < plan_.exposure.frames; ++n) {
    VENEER_ASSIGN(const CameraFrame frame, grab(exposure_s));
    if (n == 0) {
      picture.counts = Image<Rgb32f>(frame.counts.width(), frame.counts.height());
      picture.full_scale = frame.full_scale;
      picture.exposure_s = frame.exposure_s;
      picture.mosaic = frame.mosaic;
      picture.time = frame.time;
      sums.assign(frame.counts.pixels().size(), Eigen::Array3d::Zero());
      full.assign(frame.counts.pixels().size(), {});
    }
    if (frame.counts.width() != picture.counts.width() ||
        frame.counts.height() != picture.counts.height() ||
        frame.full_scale != picture.full_scale || frame.mosaic != picture.mosaic)
      return fail(Errc::kBadFormat,
                  "{}: its pictures change their format; let no other program set it meanwhile",
                  devices_.camera->description());
    for (std::size_t i = 0; i < sums.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint16_t count = frame.counts.pixels()[i][c];
        sums[i][static_cast<Eigen::Index>(c)] += count;
        full[i][c] = full[i][c] || count >= frame.full_scale;
      }
    }
  }
  picture.frames = plan_.exposure.frames;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    Rgb32f& pixel = picture.counts.pixels()[i];
    pixel = (sums[i] / picture.frames).cast<float>();
    for (std::size_t c = 0; c < 3; ++c) {
      if (full[i][c]) pixel[static_cast<Eigen::Index>(c)] = static_cast<float>(picture.full_scale);
    }
  }
  return picture;
}

}  // namespace veneer::capture
