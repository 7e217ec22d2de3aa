// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_loop.h"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace veneer::daemon {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

double milliseconds_since(SteadyTime begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

}  // namespace

FrameLoop::FrameLoop(const Config& config,
                     const render::Scene& scene,
                     const render::RasterFormat& raster,
                     Clock& clock,
                     PoseFeed& poses,
                     render::Renderer& renderer,
                     projector::Output& output,
                     ProfileWatcher* profiles)
    : config_(config),
      scene_(scene),
      raster_(raster),
      clock_(clock),
      poses_(poses),
      observers_(poses, scene.observer_bodies, config.presence),
      object_(config.presence),
      renderer_(renderer),
      output_(output),
      profiles_(profiles),
      codes_(raster.width, raster.height),
      target_(raster.width, raster.height) {}

Status FrameLoop::wait_for_first_pose(const std::atomic<bool>& stop) {
  constexpr Duration kStep = std::chrono::milliseconds(5);
  const Time deadline = clock_.now() + from_seconds(config_.first_pose_timeout_s);
  const auto observer_known = [this] { return observers_.known(clock_.now()); };
  const auto object_known = [this] {
    return scene_.object_body < 0 ||
           poses_.at(scene_.object_body, clock_.now()).origin != tracking::PoseOrigin::kNone;
  };
  while (!stop && !(observer_known() && object_known())) {
    VENEER_TRY(poses_.health());
    if (clock_.now() >= deadline) {
      return fail(
          Errc::kTimeout,
          "waiting for the first pose: none came within {} s for body {}; is the tracker on "
          "and the body in its range?",
          config_.first_pose_timeout_s,
          observer_known() ? fmt::format("{}", scene_.object_body)
                           : fmt::format("{}", fmt::join(observers_.bodies(), " or ")));
    }
    poses_.advance_to(clock_.now() + kStep);
  }
  return {};
}

Result<FrameRecord> FrameLoop::make_frame(std::uint64_t number, Time start) {
  const SteadyTime begin = std::chrono::steady_clock::now();
  FrameRecord record;
  record.number = number;
  record.display_time = start + from_seconds(config_.display_latency_ms * 1e-3);

  const Observers::View observer = observers_.at(record.display_time);
  record.observer = observer.body;
  record.presence = observer.seen.presence;
  record.pose_age_ms = 1e3 * to_seconds(observer.estimate.age);
  record.eye_in_world = observer.seen.world_from_body * scene_.eye_in_sensor;
  // A highlight in the wrong place tells at once that nobody knows where the eye is.
  record.specular_weight = observer.seen.certainty;
  render::FrameInput input;
  input.eye_in_world = record.eye_in_world;
  input.world_from_object = scene_.world_from_object;
  input.dither_seed = static_cast<std::uint32_t>(number);
  input.specular_weight = record.specular_weight;
  if (scene_.object_body >= 0) {
    const tracking::PoseEstimate object = poses_.at(scene_.object_body, record.display_time);
    input.world_from_object =
        object_.update(object, record.display_time).world_from_body * scene_.world_from_object;
  }
  renderer_.draw(input);

  projector::Frame frame;
  frame.number = number;
  frame.bits = raster_.bits;
  frame.display_time = record.display_time;
  if (output_.wants_pixels(number)) {
    renderer_.read_codes(codes_.view());
    frame.codes = codes_.view();
  }
  if (output_.wants_target(number)) {
    renderer_.read_target(target_.view());
    frame.target_xyz = target_.view();
  }
  renderer_.finish();
  record.statistics = renderer_.statistics();
  VENEER_TRY(output_.present(frame));
  record.frame_ms = milliseconds_since(begin);
  return record;
}

Result<RunRecord> FrameLoop::run(const std::atomic<bool>& stop, Progress& progress) {
  VENEER_TRY(wait_for_first_pose(stop));
  RunRecord run;
  run.frames.reserve(kRememberedFrames);
  const Duration period = from_seconds(1 / config_.frame_rate_hz);
  const SteadyTime begin = std::chrono::steady_clock::now();
  if (config_.frames > 0) progress.start("frames", static_cast<std::int64_t>(config_.frames));
  Time start = clock_.now();
  for (std::uint64_t number = 0; !stop && (config_.frames == 0 || number < config_.frames);
       ++number) {
    poses_.advance_to(start);
    VENEER_ASSIGN(const FrameRecord record, make_frame(number, start));
    if (run.count++ < kRememberedFrames) {
      run.frames.push_back(record);
    } else {
      run.frames[number % kRememberedFrames] = record;
    }
    if (record.presence > tracking::Presence::kTracked) ++run.held;
    if (record.presence == tracking::Presence::kLost) ++run.lost;
    if (!tracker_lost_ && poses_.lost()) {
      tracker_lost_ = true;
      spdlog::warn("{}; the picture stays as for the last pose", poses_.health().error().what);
    }
    if (record.frame_ms > 1e3 * to_seconds(period)) ++run.late;
    // In the time that is left of the period.
    if (profiles_ != nullptr) profiles_->apply(renderer_);
    // The next frame starts on the next period that has not begun yet; those in between are lost.
    start += period;
    if (const Time now = clock_.now(); now > start) {
      const auto missed = (now - start) / period + 1;
      run.dropped += static_cast<std::uint64_t>(missed);
      start += missed * period;
    }
    if (config_.frames > 0) progress.advance(1);
  }
  if (config_.frames > 0) progress.finish({});
  run.seconds = milliseconds_since(begin) * 1e-3;
  if (run.count > kRememberedFrames) {
    std::ranges::rotate(
        run.frames,
        run.frames.begin() + static_cast<std::ptrdiff_t>(run.count % kRememberedFrames));
  }
  VENEER_TRY(output_.finish());
  return run;
}

}  // namespace veneer::daemon
