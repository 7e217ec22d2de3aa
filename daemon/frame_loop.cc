// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_loop.h"

#include <fmt/ranges.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace veneer::daemon {

using namespace std::chrono_literals;
using service::FaultKind;

namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

/// Without a sample for so long the tracker counts as out of order.
constexpr Duration kSilence = 1s;
/// Later than this a frame is no late one: the program stood still.
constexpr Duration kStall = 1s;
constexpr Duration kShortestSleep = 100ms;
/// How often an output that did not go dark is told again.
constexpr Duration kTellAgain = 1s;

double milliseconds(Duration time) { return 1e3 * to_seconds(time); }

double milliseconds_since(SteadyTime begin) {
  return milliseconds(std::chrono::steady_clock::now() - begin);
}

/// What this thread has computed so far; no wait is in it.
Duration computed() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

}  // namespace

FrameLoop::FrameLoop(Parts parts, std::unique_ptr<Show> show)
    : parts_(std::move(parts)),
      show_(std::move(show)),
      period_(from_seconds(1 / parts_.config.frame_rate_hz)) {}

Status FrameLoop::wait_for_first_pose(const std::atomic<bool>& stop) {
  constexpr Duration kStep = 5ms;
  const Time deadline = parts_.clock.now() + from_seconds(parts_.config.first_pose_timeout_s);
  const auto observer_known = [this] { return show_->observers.known(parts_.clock.now()); };
  const auto object_known = [this] {
    const int body = show_->script.scene.object_body;
    return body < 0 ||
           parts_.poses.at(body, parts_.clock.now()).origin != tracking::PoseOrigin::kNone;
  };
  while (!stop && !(observer_known() && object_known())) {
    VENEER_TRY(parts_.poses.health());
    if (parts_.clock.now() >= deadline) {
      return fail(
          Errc::kTimeout,
          "waiting for the first pose: none came within {} s for body {}; is the tracker on "
          "and the body in its range?",
          parts_.config.first_pose_timeout_s,
          observer_known() ? fmt::format("{}", show_->script.scene.object_body)
                           : fmt::format("{}", fmt::join(show_->observers.bodies(), " or ")));
    }
    between_frames();
    parts_.poses.advance_to(parts_.clock.now() + kStep);
  }
  return {};
}

// --- when

void FrameLoop::follow_output() {
  display_ms_.reset();
  projector::Output* output = parts_.output.get();
  parts_.loader.set_scanout(output == nullptr ? nullptr : output->scanout());
  const std::optional<Duration> refresh =
      output != nullptr && is_real_time() ? output->refresh_period() : std::nullopt;
  if (refresh && *refresh > Duration::zero()) {
    pacer_.emplace(*refresh, parts_.config.latch == Latch::kLate);
    period_ = *refresh;
  } else if (pacer_) {
    pacer_.reset();
    period_ = from_seconds(1 / parts_.config.frame_rate_hz);
    start_ = parts_.clock.now();
  }
}

// From the first line going out to its light.
Duration FrameLoop::display_latency() const {
  return from_seconds(show_->script.config.display_latency_ms * 1e-3);
}

FrameLoop::Slot FrameLoop::next_slot(std::uint64_t number) {
  const Duration latency = display_latency();
  if (!pacer_) return {start_, start_ + latency, 0};
  const Pacer::Plan plan = pacer_->plan(number, parts_.clock.now());
  return {plan.wake, plan.refresh + latency, plan.skipped};
}

void FrameLoop::start_over() {
  if (pacer_) pacer_->start_over();
  start_ = parts_.clock.now();
}

// CLOCK_MONOTONIC stands still while the machine sleeps, so that poses from before look fresh.
void FrameLoop::notice_sleep() {
  if (!parts_.time_asleep) return;
  const Duration asleep = parts_.time_asleep();
  const Duration slept = asleep - std::exchange(slept_before_, asleep);
  if (slept < kShortestSleep) return;
  parts_.board.note_sleep(slept);
  parts_.poses.slept(slept);
  start_over();
}

// What is wrong with the poses that the picture needs.
FrameLoop::PoseTrouble FrameLoop::pose_trouble(Time now) const {
  const auto silent = [this, now](tracking::BodyId body) {
    const std::optional<Time> last = parts_.poses.last_sample(body);
    return !last || now - *last > kSilence;
  };
  if (parts_.poses.lost()) return PoseTrouble::kTracker;
  const int object = show_->script.scene.object_body;
  const bool no_object = object >= 0 && silent(object);
  const bool no_observer = std::ranges::all_of(show_->observers.bodies(), silent);
  if (no_object && no_observer) return PoseTrouble::kAll;
  if (no_object) return PoseTrouble::kObject;
  return no_observer ? PoseTrouble::kObserver : PoseTrouble::kNone;
}

void FrameLoop::notice_tracker() {
  const Time now = parts_.clock.now();
  const PoseTrouble trouble = pose_trouble(now);
  if (trouble == pose_trouble_) return;
  pose_trouble_ = trouble;
  if (trouble == PoseTrouble::kNone) {
    parts_.faults.end(FaultKind::kTracker, now);
    return;
  }
  const auto text = [&]() -> std::string {
    const int object = show_->script.scene.object_body;
    switch (trouble) {
      case PoseTrouble::kObject:
        return fmt::format(
            "no pose of the object (body {}) has come for a second: is it seen by the tracker?",
            object);
      case PoseTrouble::kObserver:
        return fmt::format(
            "no pose of the observer (body {}) has come for a second: is the tracker on and he in "
            "its range?",
            fmt::join(show_->observers.bodies(), " or "));
      case PoseTrouble::kTracker:
        if (const Status health = parts_.poses.health(); !health) return health.error().what;
        [[fallthrough]];
      default:
        return "no pose has come for a second: is the tracker on and in range?";
    }
  };
  parts_.faults.begin(
      FaultKind::kTracker,
      now,
      fmt::format("{}; the picture stays as for the last pose, without highlights", text()));
}

// --- between two frames

void FrameLoop::between_frames() {
  if (show_->profiles && show_->renderer && !show_->lost) show_->profiles->apply(*show_->renderer);
  const std::size_t rung = show_->governor.rung();
  if (parts_.loader.take_next(show_)) {
    show_->governor.begin_on(rung);
    renderer_asked_for_ = false;
  }
  parts_.loader.set_drawing(show_->renderer && !show_->lost);
}

// Whether there is an output, and a show that suits it.
bool FrameLoop::keep_output() {
  OutputKeeper& output = parts_.output;
  if (output.failed()) {
    parts_.loader.set_scanout(nullptr);
    if (show_->scanout != nullptr) drop_renderer();
    if (parts_.loader.scanout_in_use() || !output.reopen()) return false;
    dark_ = false;
    follow_output();
  }
  const Scanout* offered = output.get()->scanout();
  if (show_->renderer && show_->scanout != offered) {
    if (show_->scanout == nullptr && show_->refused == offered) {
      output.get()->give_up_scanout();
      parts_.loader.set_scanout(nullptr);
    } else {
      drop_renderer();  // made for another display
    }
  }
  // Once: where it cannot be made, the loader tries again by itself.
  if (!show_->renderer && !std::exchange(renderer_asked_for_, true)) parts_.loader.want_renderer();
  return true;
}

// What is left of a period for what follows the drawing, and for waking up late.
double FrameLoop::deadline_ms() const {
  constexpr double kOfAPeriod = 0.85;
  const double asked = show_->script.config.quality.deadline_ms;
  return asked > 0 ? asked : kOfAPeriod * milliseconds(period_);
}

void FrameLoop::drop_renderer() {
  show_->renderer.reset();
  show_->scanout_use.reset();
  show_->scanout = nullptr;
}

// --- a frame

render::FrameInput FrameLoop::look(const Slot& slot, FrameRecord& record) {
  const render::Scene& scene = show_->script.scene;
  const Observers::View observer = show_->observers.at(slot.display);
  record.observer = observer.body;
  record.presence = observer.seen.presence;
  record.pose_age_ms = 1e3 * to_seconds(observer.estimate.age);
  record.eye_in_world = observer.seen.world_from_body * scene.eye_in_sensor;
  // A highlight in the wrong place tells at once that nobody knows where the eye is.
  record.specular_weight = observer.seen.certainty;
  if (const std::optional<SampleTimes> times = parts_.poses.newest(observer.body)) {
    record.latency_ms.tracker = milliseconds(times->arrived - times->measured);
    record.latency_ms.hand_off = milliseconds(times->ready - times->arrived);
    record.latency_ms.wait = std::max(0.0, milliseconds(parts_.clock.now() - times->ready));
  }
  render::FrameInput input;
  input.eye_in_world = record.eye_in_world;
  input.world_from_object = scene.world_from_object;
  input.dither_seed = static_cast<std::uint32_t>(record.number);
  input.specular_weight = record.specular_weight;
  if (scene.object_body >= 0) {
    const tracking::BodyView object =
        show_->object.update(parts_.poses.at(scene.object_body, slot.display), slot.display);
    input.world_from_object = object.world_from_body * scene.world_from_object;
    // Nor does anybody know where the highlight is on an object that has gone.
    record.specular_weight = std::min(record.specular_weight, object.certainty);
    input.specular_weight = record.specular_weight;
  }
  return input;
}

FrameLoop::Made FrameLoop::make_frame(const Slot& slot, FrameRecord& record) {
  if (!keep_output()) {
    parts_.wishes.is_dark = true;
    return Made::kDropped;
  }
  if (parts_.wishes.dark || !show_->renderer || show_->lost) return make_dark();
  projector::Output& output = *parts_.output.get();
  render::Renderer& renderer = *show_->renderer;
  projector::Frame frame;
  // Before the pose is read: it may have to wait.
  if (show_->scanout != nullptr) {
    const Result<std::size_t> buffer = output.next_buffer();
    if (!buffer) return made_of(parts_.output.heard(tl::unexpected<Error>(buffer.error())));
    frame.buffer = *buffer;
  }
  const SteadyTime begin = std::chrono::steady_clock::now();
  const Duration computed_before = computed();
  quality::Governor& governor = show_->governor;
  governor.set_deadline(deadline_ms());
  const std::size_t steps = governor.steps();
  const quality::Governor::Choice choice = governor.next(parts_.clock.now());
  run_.quality_steps += governor.steps() - steps;
  record.rung = governor.rung();
  record.fade = choice.fade;
  parts_.board.set_rung(record.rung);
  render::FrameInput input = look(slot, record);
  input.level = choice.level;
  input.next_level = choice.next_level;
  input.fade = choice.fade;
  renderer.draw(input);
  frame.number = record.number;
  frame.bits = show_->script.profile.bits;
  frame.display_time = record.display_time;
  if (frame.buffer) renderer.draw_to_scanout(*frame.buffer);
  if (output.wants_pixels(record.number)) {
    renderer.read_codes(show_->codes.view());
    frame.codes = show_->codes.view();
  }
  if (output.wants_target(record.number)) {
    renderer.read_target(show_->target.view());
    frame.target_xyz = show_->target.view();
  }
  renderer.finish();
  // What a lost GPU left in a picture may be anything.
  if (renderer.lost()) return lose_renderer();
  // Whether or not the display takes what it drew.
  parts_.faults.end(FaultKind::kGpu, parts_.clock.now());
  record.statistics = renderer.statistics();
  const double drawn_ms = milliseconds_since(begin);
  // On a virtual clock a run is the same on any machine, so that what frames take decides nothing.
  if (is_real_time()) governor.took(choice, drawn_ms);
  const double computed_ms = milliseconds(computed() - computed_before);
  const Made made = made_of(parts_.output.present(frame));
  record.frame_ms = milliseconds_since(begin);

  service::LatencyBudget& budget = record.latency_ms;
  const double gpu_ms = record.statistics.gpu_ms.value_or(0);
  const double gpu_draw_ms = record.statistics.draw_ms.value_or(gpu_ms);
  budget.compensate = std::max(0.0, gpu_ms - gpu_draw_ms);
  // A software rasteriser does a part of the passes in our thread, and its timers do not count it.
  budget.draw = std::max(0.0, computed_ms - record.statistics.software_ms.value_or(0));
  budget.gpu_draw = std::max(gpu_draw_ms, drawn_ms - budget.draw - budget.compensate);
  budget.present = record.frame_ms - drawn_ms;
  record.handed_over = parts_.clock.now();
  budget.display = std::max(0.0, milliseconds(record.display_time - record.handed_over));
  if (pacer_) pacer_->took(std::chrono::steady_clock::now() - begin);
  if (made == Made::kShown) {
    dark_ = false;
    parts_.wishes.is_dark = false;
  }
  give_snapshot(false);
  return made;
}

FrameLoop::Made FrameLoop::made_of(OutputKeeper::Outcome outcome) {
  switch (outcome) {
    case OutputKeeper::Outcome::kDone:
      return Made::kShown;
    case OutputKeeper::Outcome::kDropped:
      return Made::kDropped;
    case OutputKeeper::Outcome::kClosed:
      return Made::kClosed;
  }
  return Made::kDropped;
}

FrameLoop::Made FrameLoop::make_dark() {
  const Time now = parts_.clock.now();
  if (!dark_ && now - dark_told_ >= (dark_failed_ ? kTellAgain : Duration::zero())) {
    dark_told_ = now;
    const OutputKeeper::Outcome outcome = parts_.output.blank();
    if (outcome == OutputKeeper::Outcome::kClosed) return Made::kClosed;
    dark_ = outcome == OutputKeeper::Outcome::kDone;
    dark_failed_ = !dark_;
  }
  give_snapshot(true);
  parts_.wishes.is_dark = dark_;
  return dark_ ? Made::kDark : Made::kDropped;
}

FrameLoop::Made FrameLoop::lose_renderer() {
  show_->lost = true;
  const Made made = make_dark();
  parts_.faults.begin(FaultKind::kGpu,
                      parts_.clock.now(),
                      "the GPU was reset and has forgotten everything; dark until another renderer "
                      "is made");
  parts_.loader.want_renderer();
  return made;
}

void FrameLoop::give_snapshot(bool dark) {
  if (parts_.wishes.snapshot.load(std::memory_order_relaxed) == nullptr) return;
  Snapshot* snapshot = parts_.wishes.snapshot.exchange(nullptr);
  if (snapshot == nullptr) return;
  const render::RasterFormat raster = show_->script.raster();
  if (!dark && snapshot->codes.width() == raster.width && snapshot->codes.height() == raster.height)
    show_->renderer->read_codes(snapshot->codes.view());
  snapshot->done.store(true, std::memory_order_release);
}

// What the display says of the frames that it has shown. Returns whether one came late.
bool FrameLoop::note_presented() {
  projector::Output* output = parts_.output.get();
  const auto seen = output == nullptr ? std::nullopt : output->last_presented();
  if (!seen) return false;
  constexpr std::uint64_t kToldWithin = 8;  // frames
  for (std::uint64_t back = 1; back <= std::min(seen_, kToldWithin); ++back) {
    FrameRecord& record = run_.frames[(seen_ - back) % kRememberedFrames];
    if (record.number != seen->number) continue;
    const Duration error = seen->time + display_latency() - record.display_time;
    // A display that is off by more is not believed.
    if (record.presented || std::chrono::abs(error) > kStall) break;
    record.presented = seen->time;
    record.pose_age_ms += milliseconds(error);
    record.latency_ms.display =
        std::max(0.0, milliseconds(record.display_time + error - record.handed_over));
    display_ms_ = record.latency_ms.display;
    break;
  }
  return pacer_->shown(seen->number, seen->time);
}

void FrameLoop::account(const Slot& slot, Made made, FrameRecord& record) {
  ++run_.count;
  FrameFigures figures;
  figures.missed = slot.missed;
  if (made == Made::kShown) {
    if (run_.frames.size() < kRememberedFrames) {
      run_.frames.push_back(record);
    } else {
      run_.frames[seen_ % kRememberedFrames] = record;
    }
    ++seen_;
    if (record.presence > tracking::Presence::kTracked) ++run_.held;
    if (record.presence == tracking::Presence::kLost) ++run_.lost;
    if (record.frame_ms > milliseconds(period_)) figures.late = true;
  } else if (made == Made::kDropped) {
    ++run_.dropped;
  }
  if (made != Made::kClosed && !first_made_ && made != Made::kDropped) {
    first_made_ = true;
    parts_.faults.first_frame();
  }
  if (pacer_) {
    if (note_presented()) figures.late = true;
  } else {
    // The next frame starts on the next period that has not begun yet; those in between are lost.
    start_ += period_;
    if (const Time now = parts_.clock.now(); now > start_) {
      const auto missed = (now - start_) / period_ + 1;
      figures.missed += static_cast<std::uint64_t>(missed);
      start_ += missed * period_;
    }
  }
  run_.dropped += figures.missed;
  if (figures.late) ++run_.late;
  if (parts_.clock.now() - slot.wake > kStall) start_over();
  figures.done = parts_.clock.now();
  figures.frame_ms = record.frame_ms;
  if (record.statistics.gpu_ms) figures.gpu_ms = *record.statistics.gpu_ms;
  figures.out = made != Made::kDropped;
  figures.dark = made != Made::kShown;
  figures.dropped = run_.dropped;
  figures.late_total = run_.late;
  figures.latency_ms = record.latency_ms;
  // Of this frame it is known a refresh or two later.
  if (display_ms_) figures.latency_ms.display = *display_ms_;
  parts_.board.post(figures);
}

Result<RunRecord> FrameLoop::run(const std::atomic<bool>& stop, Progress& progress) {
  if (parts_.time_asleep) slept_before_ = parts_.time_asleep();
  follow_output();
  VENEER_TRY(wait_for_first_pose(stop));
  const std::uint64_t frames = parts_.config.frames;
  run_.frames.reserve(kRememberedFrames);
  const SteadyTime begin = std::chrono::steady_clock::now();
  if (frames > 0) progress.start("frames", static_cast<std::int64_t>(frames));
  start_ = parts_.clock.now();
  for (std::uint64_t number = 0; !stop && (frames == 0 || number < frames); ++number) {
    if (!is_real_time()) parts_.loader.serve_now(show_);
    const Slot slot = next_slot(number);
    parts_.poses.advance_to(slot.wake);
    if (parts_.before_frame) parts_.before_frame(number, parts_.clock.now());
    notice_sleep();
    FrameRecord record;
    record.number = number;
    record.display_time = slot.display;
    const Made made = make_frame(slot, record);
    if (made == Made::kClosed) break;
    notice_tracker();
    account(slot, made, record);
    // In the time that is left of the period.
    between_frames();
    if (frames > 0) progress.advance(1);
  }
  if (frames > 0) progress.finish({});
  run_.seconds = milliseconds_since(begin) * 1e-3;
  if (seen_ > kRememberedFrames) {
    std::rotate(run_.frames.begin(),
                run_.frames.begin() + static_cast<std::ptrdiff_t>(seen_ % kRememberedFrames),
                run_.frames.end());
  }
  parts_.faults.stopping();
  // Somebody asked for these frames and is to know that he does not have them.
  if (frames > 0) VENEER_TRY(parts_.output.last());
  if (projector::Output* output = parts_.output.get()) {
    const Status finished = output->finish();
    if (frames > 0) VENEER_TRY(finished);
  }
  return std::move(run_);
}

}  // namespace veneer::daemon
