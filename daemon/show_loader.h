// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <semaphore>
#include <thread>
#include <vector>

#include "base/result.h"
#include "daemon/backoff.h"
#include "daemon/faults.h"
#include "daemon/show.h"

namespace veneer::daemon {

/// Makes shows, one after another, on a thread of its own, and hands each to the frame loop, which
/// takes it between two frames without waiting and gives the old one back to be destroyed here. On
/// a virtual clock there is no such thread: the frame loop does the same when it is asked to.
class ShowLoader {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  /// Borrows all but the first two; `faults` is told of shows that cannot be made.
  ShowLoader(Devices devices, ClockKind kind, PoseFeed& poses, Clock& clock, Faults& faults);
  ~ShowLoader();
  ShowLoader(const ShowLoader&) = delete;
  ShowLoader& operator=(const ShowLoader&) = delete;

  /// The first show, made by the calling thread, which is to draw it. Then begins to serve calls.
  /// Errors: those of the renderer.
  [[nodiscard]] Result<std::unique_ptr<Show>> begin(Script script);
  /// No more calls are served, and the thread ends; shows that wait are destroyed, and the frame
  /// loop's last one is.
  void stop(std::unique_ptr<Show> last);

  // For ServiceControl: any thread.

  /// Runs `work` on the loader's thread and returns what it does, which makes a script of the
  /// current one and calls exchange(). Calls are served one after another. Who calls may lose
  /// patience while it runs: it owns what it needs.
  /// Errors: those of `work`; kTimeout (not done within `patience`), kUnavailable (stopping).
  [[nodiscard]] Status call(std::function<Status()> work,
                            std::chrono::seconds patience = kPatience);
  /// Of who calls, and with a frame loop that is to take what was made.
  static constexpr std::chrono::seconds kPatience{10};
  /// Of a reload, which may read a large material from a slow disk.
  static constexpr std::chrono::seconds kPatienceWithFiles{120};

  // For `work`.

  [[nodiscard]] const Script& current() const { return current_; }
  /// The current script with the profile that the renderer was given since it was made.
  [[nodiscard]] Script current_as_drawn() const;
  /// Draws with another script, and returns when the frame loop has taken it.
  /// Errors: those of the renderer; kInvalidOption (another raster); kTimeout, kUnavailable.
  [[nodiscard]] Status exchange(Script next);
  /// Reads the profile anew and gives it to the renderer as it is; while there is none, the next
  /// one is made of what is in the folder then.
  [[nodiscard]] Status check_profile();
  /// Counts up whenever another profile, or the same as it was read anew, is drawn with; for the
  /// loader's thread, as are the profiles that current() names.
  [[nodiscard]] std::uint64_t profile_changes() const;
  /// Called by the loader's thread every now and then: what is to be looked after beside.
  void set_chore(std::function<void()> chore) { chore_ = std::move(chore); }

  // For the frame loop.

  /// Exchanges `show` for the next one, if there is one: the old one is given back. Never waits.
  /// Returns whether it did.
  bool take_next(std::unique_ptr<Show>& show);
  /// The renderer of the current show is lost or gone: another is to be made. Never waits.
  void want_renderer();
  /// Whether there is a renderer that can draw. Never waits.
  void set_drawing(bool drawing) { drawing_ = drawing; }
  /// What the output offers to draw into; null where nothing. Not while an old one is in use.
  void set_scanout(const Scanout* scanout);
  /// Whether anything here still draws, or will, into the buffers that were set before.
  [[nodiscard]] bool scanout_in_use() const { return scanout_users_ > 0; }
  /// On a virtual clock: does what the thread does in real time. `show` is the frame loop's.
  void serve_now(std::unique_ptr<Show>& show);

  /// On a virtual clock, for the frame loop's own thread: what it draws with. Null for others.
  [[nodiscard]] Show* show_here() const;

  /// What became of profiles, of the shows that are over.
  [[nodiscard]] ProfileCounts profile_counts() const;
  /// Of the renderer that draws.
  [[nodiscard]] std::string renderer_description() const;
  /// The paths that are shown, for the status.
  struct Names {
    std::string scene;
    std::string material;
    std::string profile;
    double luminance_ceiling = 0;
    std::vector<std::string> rungs;  ///< of the quality, best first
  };
  [[nodiscard]] Names names() const;

 private:
  struct Call {
    std::function<Status()> work;
    std::atomic<bool> given_up{false};
    bool done = false;
    Status result;
  };

  void run(const std::stop_token& stop);
  void serve();
  void remake();
  void dispose_of_used();
  void retire(std::unique_ptr<Show> show);
  [[nodiscard]] Result<std::unique_ptr<Show>> make(Script script);
  [[nodiscard]] Status offer(std::unique_ptr<Show> show);
  void describe(const Show& show);
  [[nodiscard]] bool inline_here() const;

  const Devices devices_;
  const ClockKind kind_;
  PoseFeed& poses_;
  Clock& clock_;
  Faults& faults_;
  std::function<void()> chore_;

  // The loader's own.
  Script current_;
  Show* shown_ = nullptr;  // the frame loop's; it lives until it comes back here
  std::uint64_t later_shows_ = 0;
  Backoff backoff_;
  const std::atomic<bool>* given_up_ = nullptr;

  // Owned by whoever exchanges them for null: to the frame loop, and back from it.
  std::atomic<Show*> next_{nullptr};
  std::atomic<Show*> used_{nullptr};
  std::atomic<bool> renderer_wanted_{false};
  std::atomic<bool> drawing_{true};
  mutable std::mutex scanout_mutex_;
  const Scanout* scanout_ = nullptr;
  std::atomic<int> scanout_users_{0};

  std::timed_mutex turn_;  // of calls
  std::mutex call_mutex_;
  std::condition_variable call_done_;
  std::shared_ptr<Call> call_;  // shared with the caller, who may lose patience
  std::atomic<bool> serving_{false};
  std::unique_ptr<Show>* frame_loops_show_ = nullptr;  // while it serves itself
  std::thread::id frame_thread_;
  std::counting_semaphore<1024> wake_{0};

  mutable std::mutex about_mutex_;
  std::string renderer_description_;
  Names names_;
  ProfileCounts retired_counts_;

  std::jthread thread_;  // last: it stops before what it uses goes
};

}  // namespace veneer::daemon
