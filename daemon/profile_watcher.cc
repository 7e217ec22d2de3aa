// SPDX-License-Identifier: Apache-2.0
#include "daemon/profile_watcher.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace veneer::daemon {
namespace {

using SteadyClockPoint = std::chrono::steady_clock::time_point;

// How long one that was asked for, or was used, may wait for the watcher.
constexpr std::chrono::milliseconds kFlagInterval{50};
// One that takes another's place may be missing for one look, on file systems that cannot exchange
// two names.
constexpr int kMissingLooks = 3;

double milliseconds_since(SteadyClockPoint begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

}  // namespace

struct ProfileWatcher::HandOver {
  render::PreparedProfile profile;
  FileIdentity identity;
  Status taken;
  double swap_ms = 0;
};

ProfileWatcher::ProfileWatcher(std::filesystem::path folder,
                               const std::optional<FileIdentity>& known,
                               const render::RasterFormat& raster,
                               const render::RendererOptions& options,
                               std::function<void(const Status&)> heard,
                               const WatchOptions& watch)
    : folder_(std::move(folder)),
      raster_(raster),
      options_(options),
      heard_(std::move(heard)),
      interval_(watch.interval),
      watcher_([this, known](const std::stop_token& stop) { this->watch(stop, known); }) {}

ProfileWatcher::~ProfileWatcher() {
  stop();
  delete prepared_.exchange(nullptr);
  delete used_.exchange(nullptr);
}

void ProfileWatcher::refuse(const Error& error) {
  ++refusals_;
  spdlog::warn("the new projector profile is refused, the old one stays: {}", error.what);
  answer(tl::unexpected<Error>(error));
}

void ProfileWatcher::answer(const Status& status) {
  if (heard_) heard_(status);
  {
    const std::scoped_lock lock(answer_mutex_);
    ++answers_;
    last_answer_ = status;
  }
  answered_.notify_all();
}

Status ProfileWatcher::check(std::chrono::milliseconds patience,
                             const std::function<bool()>& drawing) {
  std::unique_lock lock(answer_mutex_);
  const std::uint64_t before = answers_;
  const SteadyClockPoint deadline = std::chrono::steady_clock::now() + patience;
  asked_ = true;
  while (!answered_.wait_until(lock,
                               std::min(deadline, std::chrono::steady_clock::now() + kFlagInterval),
                               [&] { return answers_ != before; })) {
    if (!drawing())
      return fail(Errc::kUnavailable, "reading the projector profile anew: no frames are drawn");
    if (std::chrono::steady_clock::now() >= deadline)
      return fail(Errc::kTimeout, "reading the projector profile anew: no frame took it in time");
  }
  return last_answer_;
}

// Prepares what is in the folder and leaves it for the frame loop; false where the folder was
// exchanged meanwhile, so that it must be read again.
bool ProfileWatcher::read(const FileIdentity& found) {
  auto profile = calibration::ProjectorProfile::load(folder_);
  if (identify(folder_ / kProfileFile) != std::optional(found)) return false;
  if (!profile) {
    refuse(profile.error());
    return true;
  }
  if (const Status fits = render::check_exchangeable(raster_, *profile); !fits) {
    refuse(fits.error());
    return true;
  }
  auto prepared = render::PreparedProfile::prepare(std::move(*profile), options_);
  if (!prepared) {
    refuse(prepared.error());
    return true;
  }
  auto next = std::make_unique<HandOver>(HandOver{std::move(*prepared), found, {}, 0});
  // One that the frame loop has not taken yet is overtaken.
  delete prepared_.exchange(next.release());
  return true;
}

void ProfileWatcher::dispose_of_used() {
  const std::unique_ptr<HandOver> used(used_.exchange(nullptr));
  if (!used) return;
  if (!used->taken) {
    refuse(used->taken.error());
    return;
  }
  auto given = std::make_shared<const Given>(Given{used->profile.profile(), used->identity});
  {
    const std::scoped_lock lock(answer_mutex_);
    given_ = std::move(given);
  }
  ++reloads_;
  longest_swap_ms_ = std::max(longest_swap_ms_.load(), used->swap_ms);
  spdlog::info("the projector profile was exchanged in {:.1f} ms", used->swap_ms);
  answer({});
}

void ProfileWatcher::watch(const std::stop_token& stop, std::optional<FileIdentity> known) {
  int missing = 0;
  // One may have come while the renderer was made, which may not be drawn with for long.
  SteadyClockPoint looked = std::chrono::steady_clock::now() - interval_;
  for (bool first = true; !stop.stop_requested(); first = false) {
    if (!first) std::this_thread::sleep_for(std::min(kFlagInterval, interval_));
    dispose_of_used();
    const bool asked = asked_.exchange(false);
    const SteadyClockPoint now = std::chrono::steady_clock::now();
    if (!asked && now - looked < interval_) continue;
    looked = now;
    const std::optional<FileIdentity> found = identify(folder_ / kProfileFile);
    if (!found) {
      if (asked || ++missing == kMissingLooks) {
        missing = kMissingLooks;
        answer(fail(Errc::kNotFound,
                    "looking at the projector profile: there is no {}; the one that was read is "
                    "still used; put it back or calibrate",
                    (folder_ / "profile.json").string()));
      }
      continue;
    }
    if (missing >= kMissingLooks && found == known) answer({});
    missing = 0;
    if (found == known && !asked) continue;
    if (read(*found)) known = found;
  }
  dispose_of_used();
}

std::shared_ptr<const ProfileWatcher::Given> ProfileWatcher::given() {
  dispose_of_used();
  const std::scoped_lock lock(answer_mutex_);
  return given_;
}

void ProfileWatcher::apply(render::Renderer& renderer) {
  // The last one must have been disposed of, so that none is lost.
  if (prepared_.load(std::memory_order_relaxed) == nullptr || used_.load() != nullptr) return;
  HandOver* next = prepared_.exchange(nullptr);
  if (next == nullptr) return;
  const SteadyClockPoint begin = std::chrono::steady_clock::now();
  next->taken = renderer.set_profile(next->profile);
  next->swap_ms = milliseconds_since(begin);
  used_.store(next);
}

void ProfileWatcher::stop() {
  watcher_.request_stop();
  if (watcher_.joinable()) watcher_.join();
}

ProfileCounts ProfileWatcher::counts() const { return {reloads_, refusals_, longest_swap_ms_}; }

}  // namespace veneer::daemon
