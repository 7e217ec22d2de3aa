// SPDX-License-Identifier: Apache-2.0
#include "daemon/show_loader.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace veneer::daemon {

using namespace std::chrono_literals;
using service::FaultKind;

namespace {

/// How often the thread looks for what the frame loop gave back.
constexpr std::chrono::milliseconds kLook = 50ms;

tl::unexpected<Error> not_running() {
  return fail(Errc::kUnavailable,
              "telling veneerd: it is not running (starting or stopping); try again in a moment");
}

tl::unexpected<Error> no_patience(std::chrono::seconds patience) {
  return fail(Errc::kTimeout,
              "telling veneerd: it was still busy after {} s; nothing was changed; try again",
              patience.count());
}

}  // namespace

ShowLoader::ShowLoader(
    Devices devices, ClockKind kind, PoseFeed& poses, Clock& clock, Faults& faults)
    : devices_(std::move(devices)), kind_(kind), poses_(poses), clock_(clock), faults_(faults) {}

ShowLoader::~ShowLoader() { stop(nullptr); }

Result<std::unique_ptr<Show>> ShowLoader::begin(Script script) {
  VENEER_ASSIGN(std::unique_ptr<Show> show, make(std::move(script)));
  current_ = show->script;
  shown_ = show.get();
  describe(*show);
  frame_thread_ = std::this_thread::get_id();
  serving_ = true;
  if (kind_ == ClockKind::kMonotonic)
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  return show;
}

void ShowLoader::stop(std::unique_ptr<Show> last) {
  serving_ = false;
  thread_.request_stop();
  wake_.release();
  if (thread_.joinable()) thread_.join();
  {
    // Whoever waits is told.
    const std::scoped_lock lock(call_mutex_);
    if (call_ && !call_->done) {
      call_->result = not_running();
      call_->done = true;
    }
  }
  call_done_.notify_all();
  if (Show* next = next_.exchange(nullptr)) retire(std::unique_ptr<Show>(next));
  dispose_of_used();
  shown_ = nullptr;
  if (last) retire(std::move(last));
}

bool ShowLoader::inline_here() const {
  return kind_ == ClockKind::kVirtual && std::this_thread::get_id() == frame_thread_;
}

// --- the loader's side

void ShowLoader::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    (void)wake_.try_acquire_for(kLook);
    dispose_of_used();
    if (stop.stop_requested()) break;
    if (renderer_wanted_) remake();
    serve();
    if (chore_) chore_();
  }
}

void ShowLoader::serve() {
  std::shared_ptr<Call> call;
  {
    const std::scoped_lock lock(call_mutex_);
    if (!call_ || call_->done) return;
    call = call_;
  }
  given_up_ = &call->given_up;
  Status result = call->given_up ? Status(no_patience(kPatience)) : call->work();
  given_up_ = nullptr;
  {
    const std::scoped_lock lock(call_mutex_);
    call->result = std::move(result);
    call->done = true;
  }
  call_done_.notify_all();
}

// The GPU has forgotten everything, or its display went away: the same again.
void ShowLoader::remake() {
  if (!backoff_.due(clock_.now())) return;
  // What came meanwhile, which nobody gives to a lost one.
  Script script = current_;
  if (Status status = read_profile(script, nullptr);
      !status || !render::check_exchangeable(current_.raster(), script.profile)) {
    script = current_as_drawn();
  }
  Result<std::unique_ptr<Show>> made = make(std::move(script));
  Status status;
  if (made) {
    renderer_wanted_ = false;
    status = offer(*std::move(made));
  } else {
    status = tl::unexpected<Error>(made.error());
  }
  if (status) {
    backoff_.succeeded();
    return;
  }
  renderer_wanted_ = true;
  backoff_.failed(clock_.now());
  faults_.begin(FaultKind::kGpu,
                clock_.now(),
                fmt::format("making another renderer: {}; tried again and again, dark meanwhile",
                            status.error().what));
}

Result<std::unique_ptr<Show>> ShowLoader::make(Script script) {
  VENEER_TRY(poses_.follow(bodies_of(script.scene)));
  std::unique_ptr<std::atomic<int>, ScanoutUse> use;
  const Scanout* scanout = nullptr;
  const Scanout* refused = nullptr;
  {
    const std::scoped_lock lock(scanout_mutex_);
    scanout = scanout_;
    if (scanout != nullptr) {
      ++scanout_users_;
      use.reset(&scanout_users_);
    }
  }
  std::vector<render::Level> levels;
  for (const Script::Rung& rung : script.rungs)
    levels.push_back({rung.material.get(), rung.drawing});
  auto renderer =
      devices_.make_renderer(script.scene, levels, script.profile, script.config.render, scanout);
  if (!renderer && scanout != nullptr && renderer.error().code == Errc::kUnavailable) {
    spdlog::warn("the renderer cannot draw into the display's buffers, pixels are copied: {}",
                 renderer.error().what);
    use.reset();
    refused = std::exchange(scanout, nullptr);
    renderer =
        devices_.make_renderer(script.scene, levels, script.profile, script.config.render, nullptr);
  }
  if (!renderer) return tl::unexpected<Error>(std::move(renderer).error());
  auto show = std::make_unique<Show>(std::move(script), poses_, *std::move(renderer));
  show->description = show->renderer->description();
  show->renderer->release();
  show->scanout = scanout;
  show->refused = refused;
  show->scanout_use = std::move(use);
  const Config& config = show->script.config;
  if (config.render.exchangeable) {
    show->profiles = std::make_unique<ProfileWatcher>(
        config.profile,
        show->script.profile_identity,
        show->script.raster(),
        config.render,
        [this](const Status& status) {
          if (status) {
            faults_.end(FaultKind::kProfile, clock_.now());
          } else {
            faults_.begin(FaultKind::kProfile, clock_.now(), status.error().what);
          }
        });
  }
  return show;
}

// Waits until the frame loop has taken it.
Status ShowLoader::offer(std::unique_ptr<Show> show) {
  // From here on: however long it took to read and to make it.
  const Instant deadline = std::chrono::steady_clock::now() + kPatience;
  Show* offered = show.get();
  if (Show* overtaken = next_.exchange(show.release())) retire(std::unique_ptr<Show>(overtaken));
  if (inline_here()) {
    take_next(*frame_loops_show_);
  } else {
    while (next_.load() != nullptr) {
      if (!serving_ || std::chrono::steady_clock::now() > deadline ||
          (given_up_ != nullptr && *given_up_)) {
        if (Show* back = next_.exchange(nullptr)) {
          retire(std::unique_ptr<Show>(back));
          return serving_ ? Status(no_patience(kPatience)) : Status(not_running());
        }
        break;  // taken at the last moment
      }
      std::this_thread::sleep_for(1ms);
      dispose_of_used();
    }
  }
  // It lives until it comes back, which only this thread sees to.
  shown_ = offered;
  ++later_shows_;
  current_ = offered->script;
  describe(*offered);
  dispose_of_used();
  return {};
}

Script ShowLoader::current_as_drawn() const {
  Script script = current_;
  if (shown_ == nullptr || !shown_->profiles) return script;
  if (const auto given = shown_->profiles->given()) {
    script.profile = given->profile;
    script.profile_identity = given->identity;
  }
  return script;
}

Status ShowLoader::exchange(Script next) {
  if (const Status fits = render::check_exchangeable(current_.raster(), next.profile); !fits)
    return fits;
  next.config.render.exchangeable = kind_ == ClockKind::kMonotonic;
  VENEER_ASSIGN(std::unique_ptr<Show> show, make(std::move(next)));
  return offer(std::move(show));
}

Status ShowLoader::check_profile() {
  if (shown_ != nullptr && shown_->profiles) {
    // The thread that waits here is the one that would make a lost renderer anew.
    const auto drawing = [this] { return drawing_.load(); };
    const Status checked = shown_->profiles->check(
        std::chrono::duration_cast<std::chrono::milliseconds>(kPatience), drawing);
    if (checked || checked.error().code != Errc::kUnavailable) return checked;
  }
  Script script = current_;
  VENEER_TRY(read_profile(script, nullptr));
  if (drawing_) return exchange(std::move(script));
  return render::check_exchangeable(current_.raster(), script.profile);
}

void ShowLoader::dispose_of_used() {
  if (Show* used = used_.exchange(nullptr)) retire(std::unique_ptr<Show>(used));
}

void ShowLoader::retire(std::unique_ptr<Show> show) {
  if (!show->profiles) return;
  show->profiles->stop();
  const ProfileCounts counts = show->profiles->counts();
  const std::scoped_lock lock(about_mutex_);
  retired_counts_.reloads += counts.reloads;
  retired_counts_.refusals += counts.refusals;
  retired_counts_.longest_swap_ms =
      std::max(retired_counts_.longest_swap_ms, counts.longest_swap_ms);
}

// --- the callers' side

Status ShowLoader::call(std::function<Status()> work, std::chrono::seconds patience) {
  if (!serving_) return not_running();
  if (inline_here()) return work();
  if (std::this_thread::get_id() == frame_thread_) {
    return fail(Errc::kUnavailable,
                "telling veneerd from its own frame loop: it would wait for itself");
  }
  const Instant deadline = std::chrono::steady_clock::now() + patience;
  const std::unique_lock turn(turn_, deadline);
  if (!turn) return no_patience(patience);
  const auto call = std::make_shared<Call>();
  call->work = std::move(work);
  std::unique_lock lock(call_mutex_);
  if (!serving_) return not_running();
  // One whose caller lost patience may still be at work; it sees that it is given up.
  if (!call_done_.wait_until(lock, deadline, [this] { return !call_ || call_->done; }))
    return no_patience(patience);
  call_ = call;
  wake_.release();
  if (!call_done_.wait_until(lock, deadline, [&] { return call->done; })) {
    call->given_up = true;
    return no_patience(patience);
  }
  return call->result;
}

// --- the frame loop's side

bool ShowLoader::take_next(std::unique_ptr<Show>& show) {
  // The last one must have been disposed of, so that none is lost.
  if (next_.load(std::memory_order_relaxed) == nullptr || used_.load() != nullptr) return false;
  if (show && show->renderer) show->renderer->release();
  Show* next = next_.exchange(nullptr);
  if (next == nullptr) return false;
  used_.store(show.release());
  show.reset(next);
  wake_.release();
  return true;
}

void ShowLoader::want_renderer() {
  if (renderer_wanted_.exchange(true)) return;
  wake_.release();
}

void ShowLoader::set_scanout(const Scanout* scanout) {
  const std::scoped_lock lock(scanout_mutex_);
  scanout_ = scanout;
}

void ShowLoader::serve_now(std::unique_ptr<Show>& show) {
  frame_loops_show_ = &show;
  if (renderer_wanted_) remake();
  serve();
  if (chore_) chore_();
}

Show* ShowLoader::show_here() const {
  return inline_here() && frame_loops_show_ != nullptr ? frame_loops_show_->get() : nullptr;
}

// --- what it tells

void ShowLoader::describe(const Show& show) {
  const Config& config = show.script.config;
  const std::scoped_lock lock(about_mutex_);
  renderer_description_ = show.description;
  names_ = {config.scene.string(),
            fmt::format(
                "{} ({})",
                (config.quality.ladder.empty() ? config.material : config.quality.ladder).string(),
                show.script.material->model()),
            config.profile.string(),
            config.render.luminance_ceiling,
            {}};
  for (const Script::Rung& rung : show.script.rungs) names_.rungs.push_back(rung.name);
}

std::uint64_t ShowLoader::profile_changes() const {
  const bool watched = shown_ != nullptr && shown_->profiles;
  return later_shows_ + profile_counts().reloads +
         (watched ? shown_->profiles->counts().reloads : 0);
}

ProfileCounts ShowLoader::profile_counts() const {
  const std::scoped_lock lock(about_mutex_);
  return retired_counts_;
}

std::string ShowLoader::renderer_description() const {
  const std::scoped_lock lock(about_mutex_);
  return renderer_description_;
}

ShowLoader::Names ShowLoader::names() const {
  const std::scoped_lock lock(about_mutex_);
  return names_;
}

}  // namespace veneer::daemon
