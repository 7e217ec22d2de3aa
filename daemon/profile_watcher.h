// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string_view>
#include <thread>

#include "base/result.h"
#include "calibration/profile.h"
#include "daemon/file_identity.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"

namespace veneer::daemon {

struct WatchOptions {
  /// Between two looks at the folder. A calibration takes minutes; a second more does not matter,
  /// and asking works on every file system. At least 1 ms.
  std::chrono::milliseconds interval{1000};
};

/// What became of profiles that appeared while the daemon ran.
struct ProfileCounts {
  std::uint64_t reloads = 0;
  std::uint64_t refusals = 0;  ///< damaged, or not for this raster
  double longest_swap_ms = 0;  ///< on the frame loop's thread
};

/// Watches a profile's folder. A thread of its own loads and prepares what appears there; the frame
/// loop takes it between two frames, without waiting, and hands it back to be disposed of. What
/// cannot be read or does not fit is refused with one line in the log, and the old one stays. A
/// folder without a profile.json is left alone: a profile that takes its place comes by rename.
class ProfileWatcher {
 public:
  /// The file of the folder by which a profile is known.
  static constexpr std::string_view kProfileFile = "profile.json";

  /// @param known  which kProfileFile stood in the folder before the renderer's profile was read;
  ///               one that came since is looked for at once.
  /// @param raster, options  the renderer's.
  /// @param heard  called by the watching thread, or by who asks for given(), with what became of a
  ///               profile, or with kNotFound once where the folder has been without one for a
  ///               while; may be empty.
  ProfileWatcher(std::filesystem::path folder,
                 const std::optional<FileIdentity>& known,
                 const render::RasterFormat& raster,
                 const render::RendererOptions& options,
                 std::function<void(const Status&)> heard,
                 const WatchOptions& watch = {});
  ~ProfileWatcher();
  ProfileWatcher(const ProfileWatcher&) = delete;
  ProfileWatcher& operator=(const ProfileWatcher&) = delete;

  /// Reads the folder, changed or not, and waits until frames are drawn with what is there.
  /// @param drawing  whether frames are drawn; where they are not, none is waited for
  /// Errors: why it was refused; kTimeout where no frame took it within `patience`; kUnavailable
  /// where none is drawn.
  [[nodiscard]] Status check(std::chrono::milliseconds patience,
                             const std::function<bool()>& drawing);
  /// The profile that the renderer was given last, and which file it was; nothing while it has the
  /// one that it was made with. Any thread but the frame loop's: it may wait.
  struct Given {
    calibration::ProjectorProfile profile;
    FileIdentity identity;
  };
  [[nodiscard]] std::shared_ptr<const Given> given();
  /// For the frame loop: gives a newly prepared profile, if there is one, to the renderer. Never
  /// waits, and allocates only what GL does.
  void apply(render::Renderer& renderer);
  /// Ends the thread; what was applied is counted after that.
  void stop();
  [[nodiscard]] ProfileCounts counts() const;

 private:
  struct HandOver;
  void watch(const std::stop_token& stop, std::optional<FileIdentity> known);
  [[nodiscard]] bool read(const FileIdentity& found);
  void dispose_of_used();
  void refuse(const Error& error);
  void answer(const Status& status);

  const std::filesystem::path folder_;
  const render::RasterFormat raster_;
  const render::RendererOptions options_;
  const std::function<void(const Status&)> heard_;
  const std::chrono::milliseconds interval_;
  // Owned by whoever exchanges them for null: to the frame loop, and back from it.
  std::atomic<HandOver*> prepared_{nullptr};
  std::atomic<HandOver*> used_{nullptr};
  std::atomic<bool> asked_{false};
  std::mutex answer_mutex_;
  std::condition_variable answered_;
  std::uint64_t answers_ = 0;
  Status last_answer_;
  std::shared_ptr<const Given> given_;
  std::atomic<std::uint64_t> reloads_{0};
  std::atomic<std::uint64_t> refusals_{0};
  std::atomic<double> longest_swap_ms_{0};
  std::jthread watcher_;  // last: it stops before what it uses goes
};

}  // namespace veneer::daemon
