// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/soak.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>

#include "base/progress.h"

namespace veneer::soak {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::ServiceStatus;

constexpr std::size_t kMostTexts = 100;
/// A census is waited for until all is over, so that it costs injections.
constexpr double kMostCensuses = 20;
constexpr double kLeastCensuses = 10;
/// After the last fault, until what it used is given back by all threads.
constexpr Duration kCalm = 500ms;
/// A machine that is busy for so long after a fault's cause has gone cannot show the fault's end.
constexpr Duration kNeverCalm = 60s;
/// Before the first injection: all is compiled, and every ring has gone round.
constexpr Duration kWarmUp = 5s;
/// The tracker may need this to be missed, the certainty to fade, and a frame to be drawn.
constexpr Duration kHighlightsGone = 2s;
/// From a state to what is seen: frames, or looks in real time; and where the frame loop has to
/// wait for a processor.
constexpr int kFewFrames = 5;
constexpr int kManyFrames = 100;

bool lists(const ServiceStatus& status, FaultKind kind) {
  return std::ranges::any_of(status.faults,
                             [kind](const service::Fault& fault) { return fault.kind == kind; });
}

std::string faults_of(const ServiceStatus& status) {
  std::string text{name_of(status.state)};
  for (const service::Fault& fault : status.faults)
    text += fmt::format("; {}: {}", name_of(fault.kind), fault.text);
  return text;
}

}  // namespace

std::string text_of(const SoakResult& result) {
  std::string text = fmt::format("{:24} {:>9} {:>9} {:>7} {:>9} {:>10} {:>9}\n",
                                 "injected",
                                 "times",
                                 "met",
                                 "listed",
                                 "recovered",
                                 "longest s",
                                 "allowed s");
  for (const InjectionKind& kind : injection_kinds()) {
    const Tally& tally = result.tallies[static_cast<std::size_t>(kind.injection)];
    if (tally.injected == 0) continue;
    text += fmt::format("{:24} {:9} {:9} {:7} {:9} {:10.2f} {:9.0f}\n",
                        kind.name,
                        tally.injected,
                        tally.met,
                        tally.listed,
                        tally.recovered,
                        to_seconds(tally.longest),
                        to_seconds(recovery_limit(kind)));
  }
  text += fmt::format(
      "{} injections of {} kinds in {:.0f} s of the daemon's time, {:.0f} s of real time\n"
      "{} frames seen of {} drawn by {} renderers; the brightest pixel {:.2f} cd/m^2, {} frames "
      "over the ceiling; without a new picture {:.1f} s; the machine was busy with other things "
      "for {:.0f} s\n",
      result.injected,
      result.kinds,
      result.daemon_seconds,
      result.real_seconds,
      result.picture.frames,
      result.draws,
      result.renderers,
      result.picture.brightest_nits,
      result.picture.too_bright,
      result.dark_seconds,
      result.busy_seconds);
  for (const Holdings& holdings : result.holdings) text += "  " + text_of(holdings) + "\n";
  return text;
}

Soak::Soak(const SoakOptions& options, std::unique_ptr<Stage> stage)
    : options_(options),
      stage_(std::move(stage)),
      display_(LightMeter(stage_->good_profile()), options.ceiling_nits),
      random_(options.seed),
      census_every_s_(options.seconds /
                      std::clamp(options.seconds / 30, kLeastCensuses, kMostCensuses)) {}

Result<std::unique_ptr<Soak>> Soak::create(const SoakOptions& options) {
  count_gl_objects();
  Stage::Options stage_options;
  stage_options.virtual_time = options.virtual_time;
  stage_options.frame_rate_hz = options.frame_rate_hz;
  stage_options.ceiling_nits = options.ceiling_nits;
  VENEER_ASSIGN(auto stage, Stage::create(stage_options));
  std::unique_ptr<Soak> soak(new Soak(options, std::move(stage)));
  daemon::Devices devices = faulty_devices(soak->stage_->config(),
                                           options.frame_rate_hz,
                                           soak->switches_,
                                           soak->display_,
                                           soak->laws_,
                                           soak->clock_);
  if (options.virtual_time)
    devices.before_frame = [raw = soak.get()](std::uint64_t, Time) { raw->tick(); };
  VENEER_ASSIGN(soak->daemon_,
                daemon::Daemon::create(soak->stage_->config(), {}, std::move(devices)));
  return soak;
}

Result<SoakResult> Soak::run() {
  // A full disk is told by an error, not by the end of the process.
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  const auto real_begin = std::chrono::steady_clock::now();
  std::jthread injector;
  if (!options_.virtual_time) {
    injector = std::jthread([this](const std::stop_token& ended) {
      while (!ended.stop_requested()) {
        std::this_thread::sleep_for(20ms);
        if (clock_ != nullptr && daemon_->frames() > 0) tick();
      }
    });
  }
  SilentProgress silent;
  const Result<daemon::Summary> summary = daemon_->run(stop_, silent);
  if (injector.joinable()) {
    injector.request_stop();
    injector.join();
  }
  std::signal(SIGXFSZ, before);
  if (!summary) return fail_while("running the daemon", summary.error());
  result_.real_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - real_begin).count();
  result_.picture = display_.picture();
  result_.draws = laws_.draws;
  result_.renderers = laws_.renderers;
  if (laws_.not_finite > 0)
    violate(fmt::format("{} frames were drawn for a pose that is none", laws_.not_finite.load()));
  for (const InjectionKind& kind : injection_kinds()) {
    Tally& tally = result_.tallies[static_cast<std::size_t>(kind.injection)];
    tally.met = switches_.times_met(kind.injection);
    result_.kinds += tally.injected > 0 ? 1 : 0;
  }
  return result_;
}

Time Soak::now() const { return clock_.load()->now() - jumped_; }

void Soak::violate(const std::string& text) {
  ++result_.violation_count;
  if (result_.violations.size() < kMostTexts)
    result_.violations.push_back(
        fmt::format("at {:.2f} s: {}", begin_ ? to_seconds(now() - *begin_) : 0.0, text));
}

void Soak::tick() {
  const Time time = now();
  if (!begin_) {
    begin_ = last_tick_ = time;
    next_injection_ = time + kWarmUp;
  }
  result_.daemon_seconds = to_seconds(time - *begin_);
  if (!options_.virtual_time && load_.busy()) {
    busy_ = time;
    result_.busy_seconds += to_seconds(time - last_tick_);
  }
  const ServiceStatus status = daemon_->status();
  for (std::optional<Active>& active : active_) {
    if (!active) continue;
    if (active->kind->fault && lists(status, *active->kind->fault)) active->listed = true;
    if (!active->ended && time >= active->until) end(*active);
    if (active->ended) look_for_recovery(*active, status);
    if (active->kind == nullptr) active.reset();
  }
  watch_picture(status);
  // What was begun is given the time to end.
  const bool enough = result_.daemon_seconds >= options_.seconds;
  const bool idle = std::ranges::none_of(active_, [](const auto& one) { return one.has_value(); });
  take_census(idle);
  const bool due = census_due();
  if (enough && !due) stop_ = true;
  if (!enough && !due && time >= next_injection_) {
    next_injection_ = time + from_seconds(options_.pause_s * 2 * random_.uniform());
    if (const InjectionKind* kind = choose()) begin(*kind);
  }
  last_tick_ = now();
}

// The one that comes after those that were taken; the first when all is warm.
bool Soak::census_due() const {
  return result_.daemon_seconds >=
         std::max(0.9 * to_seconds(kWarmUp),
                  census_every_s_ * static_cast<double>(result_.holdings.size()) * (1 - 1e-9));
}

void Soak::take_census(bool idle) {
  if (!idle) {
    idle_since_.reset();
    return;
  }
  if (!idle_since_) idle_since_ = now();
  if (census_due() && now() - *idle_since_ >= kCalm) result_.holdings.push_back(Holdings::now());
}

const InjectionKind* Soak::choose() {
  double sum = 0;
  const auto busy = [this](Group group) {
    return active_[static_cast<std::size_t>(group)].has_value();
  };
  const auto possible = [&](const InjectionKind& kind) {
    if (kind.when == When::kRealTime && options_.virtual_time) return false;
    if (kind.when == When::kVirtualTime && !options_.virtual_time) return false;
    if (kind.group == Group::kProjector && !laws_.control_opened) return false;
    // In real time a snapshot waits for a frame, and we for the snapshot.
    const bool snapshots =
        kind.group == Group::kDisk || kind.injection == Injection::kConcurrentCalls;
    if (snapshots && !options_.virtual_time && busy(Group::kOutput)) return false;
    // What needs a new renderer is rightly refused while none can be made.
    const bool needs_renderer = kind.group == Group::kFiles || kind.group == Group::kCalls;
    if (needs_renderer && switches_.is_on(Injection::kGpuRefusesToOpen)) return false;
    if (kind.injection == Injection::kGpuRefusesToOpen &&
        (busy(Group::kFiles) || busy(Group::kCalls)))
      return false;
    return !busy(kind.group);
  };
  for (const InjectionKind& kind : injection_kinds()) sum += possible(kind) ? kind.weight : 0;
  double left = sum * random_.uniform();
  for (const InjectionKind& kind : injection_kinds()) {
    if (!possible(kind)) continue;
    left -= kind.weight;
    if (left < 0) return &kind;
  }
  return nullptr;
}

void Soak::begin(const InjectionKind& kind) {
  Active active;
  active.kind = &kind;
  active.begun = now();
  active.until = active.begun + from_seconds(kind.shortest_s + (kind.longest_s - kind.shortest_s) *
                                                                   random_.uniform());
  ++result_.injected;
  ++result_.tallies[static_cast<std::size_t>(kind.injection)].injected;
  switches_.set(kind.injection, true);
  // A GPU that cannot be opened is noticed when it must be opened.
  if (kind.injection == Injection::kGpuRefusesToOpen) switches_.set(Injection::kGpuLost, true);
  if (kind.group == Group::kFiles) break_file(kind.injection);
  if (kind.group == Group::kCalls) storm(kind.injection);
  if (kind.group == Group::kDisk) write_when_full();
  if (kind.injection == Injection::kClockJump) jump(from_seconds(1 + 9 * random_.uniform()));
  if (kind.injection == Injection::kSuspended) jump(from_seconds(3600 * (1 + random_.uniform())));
  if (kind.injection == Injection::kStopped) stop_for_a_second();
  active_[static_cast<std::size_t>(kind.group)] = active;
}

void Soak::end(Active& active) {
  const Injection injection = active.kind->injection;
  const std::optional<Duration> limit = named_after(*active.kind);
  if (limit && now() - active.begun >= *limit)
    ++result_.tallies[static_cast<std::size_t>(injection)].lasting;
  switches_.set(injection, false);
  if (injection == Injection::kGpuRefusesToOpen) switches_.set(Injection::kGpuLost, false);
  if (active.kind->group == Group::kFiles) {
    stage_->replace_material(stage_->good_material());
    if (injection == Injection::kProfileOther || injection == Injection::kProfileDamaged ||
        injection == Injection::kProfileGone)
      stage_->write_profile(stage_->good_profile());
    stage_->write_scene();
    stage_->write_config();
    display_.allow(LightMeter(stage_->good_profile()));
    reload(true);
    display_.use(LightMeter(stage_->good_profile()));
  }
  if (active.kind->group == Group::kDisk) {
    if (injection == Injection::kDiskGone) stage_->block_state(false);
    // Without one the daemon looks by itself whether the disk is good again.
    if (options_.virtual_time || !active_[static_cast<std::size_t>(Group::kOutput)]) {
      if (const auto written = daemon_->snapshot(); !written)
        violate(fmt::format("no snapshot on a good disk: {}", written.error().what));
    }
  }
  if ((injection == Injection::kLightStorm || injection == Injection::kMaterialStorm) &&
      !active_[static_cast<std::size_t>(Group::kFiles)]) {
    if (const Status status = daemon_->set_scene(stage_->scene()); !status)
      violate(fmt::format("the scene was refused: {}", status.error().what));
    reload(true);
  }
  if (injection == Injection::kBlankStorm) {
    if (const Status status = daemon_->blank(false); !status)
      violate(fmt::format("blank was not taken back: {}", status.error().what));
  }
  active.ended = now();
  active.frames_at_end = display_.picture().frames;
}

void Soak::look_for_recovery(Active& active, const ServiceStatus& status) {
  // The status was asked for before the cause went.
  if (*active.ended >= now()) return;
  const InjectionKind& kind = *active.kind;
  const Duration took = now() - *active.ended;
  // While another thing keeps the display dark, no frame can be waited for.
  const auto busy = [&](Group group) {
    return group != kind.group && active_[static_cast<std::size_t>(group)].has_value();
  };
  const bool dark_otherwise =
      busy(Group::kOutput) || busy(Group::kGpu) || switches_.is_on(Injection::kBlankStorm);
  const bool frames = dark_otherwise || display_.picture().frames > active.frames_at_end;
  // Nor can the end of a fault while something else is there that brings it.
  const bool brought_otherwise = std::ranges::any_of(active_, [&](const auto& other) {
    return other && other->kind != nullptr && other->kind != &kind &&
           other->kind->fault == kind.fault;
  });
  const bool over = !kind.fault || !lists(status, *kind.fault);
  Tally& tally = result_.tallies[static_cast<std::size_t>(kind.injection)];
  if (frames && brought_otherwise && !over) {
    ++tally.untold;
    active.kind = nullptr;
  } else if (frames && over) {
    tally.listed += active.listed ? 1 : 0;
    tally.longest = std::max(tally.longest, took);
    ++tally.recovered;
    active.kind = nullptr;
  } else if (kind.fault == FaultKind::kLate && busy_ && now() - *busy_ <= recovery_limit(kind)) {
    // Frames are late for want of a processor; the time runs from when there is one.
    if (took <= kNeverCalm) return;
    ++tally.untold;
    active.kind = nullptr;
  } else if (took > recovery_limit(kind)) {
    violate(fmt::format("{}: not over {:.2f} s after its cause ({}; {})",
                        kind.name,
                        to_seconds(took),
                        frames ? "frames come" : "no frames",
                        faults_of(status)));
    active.kind = nullptr;
  }
}

void Soak::watch_picture(const ServiceStatus& status) {
  const Display::Picture picture = display_.picture();
  const bool output_out = active_[static_cast<std::size_t>(Group::kOutput)].has_value();
  // Only what can be reached can be made dark.
  const bool must_be_dark = !output_out && (status.state == service::State::kBlank ||
                                            status.state == service::State::kFault);
  dark_ticks_ = must_be_dark ? dark_ticks_ + 1 : 0;
  const bool busy = busy_ && now() - *busy_ < 1s;
  if (dark_ticks_ == (busy ? kManyFrames : kFewFrames) && picture.lit > 0)
    violate(fmt::format("{} pixels are lit, and the state is {}", picture.lit, faults_of(status)));
  if (now() - picture.shown_at > 200ms + jumped_ || picture.lit == 0)
    result_.dark_seconds += to_seconds(now() - last_tick_);
  // Nobody knows where the eye is: no highlights.
  const auto& tracker = active_[static_cast<std::size_t>(Group::kTracker)];
  const bool silent = tracker && !tracker->ended &&
                      (tracker->kind->injection == Injection::kTrackerGone ||
                       tracker->kind->injection == Injection::kTrackerSilent);
  lost_ticks_ = silent ? lost_ticks_ + 1 : 0;
  const double lost_s = lost_ticks_ / (options_.virtual_time ? options_.frame_rate_hz : 50.0);
  const bool drawing = !output_out && status.state == service::State::kDegraded;
  if (lost_s > to_seconds(kHighlightsGone) && drawing && laws_.specular_weight > 0 &&
      !active_[static_cast<std::size_t>(Group::kGpu)]) {
    violate(fmt::format(
        "highlights of {} without a pose for {:.2f} s", laws_.specular_weight.load(), lost_s));
    lost_ticks_ = 0;
  }
}

}  // namespace veneer::soak
