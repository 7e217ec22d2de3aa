// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile_store.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <optional>
#include <system_error>
#include <utility>

#include "base/files.h"

namespace veneer::calibration {
namespace {

namespace fs = std::filesystem;
using Milliseconds = std::chrono::milliseconds;

constexpr const char* kManifest = "profile.json";

// "2026-11-28T01-02-03.456Z": sorts as time does, and has no character that a file system refuses.
std::string name_of(Milliseconds since_epoch) {
  const std::int64_t seconds = since_epoch.count() / 1000;
  const std::time_t time = seconds;
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  return fmt::format("{:04}-{:02}-{:02}T{:02}-{:02}-{:02}.{:03}Z",
                     utc.tm_year + 1900,
                     utc.tm_mon + 1,
                     utc.tm_mday,
                     utc.tm_hour,
                     utc.tm_min,
                     utc.tm_sec,
                     since_epoch.count() - 1000 * seconds);
}

std::optional<Milliseconds> time_of(const std::string& name) {
  std::tm utc{};
  int milliseconds = 0;
  const int fields = std::sscanf(name.c_str(),  // NOLINT: the name is checked below
                                 "%4d-%2d-%2dT%2d-%2d-%2d.%3dZ",
                                 &utc.tm_year,
                                 &utc.tm_mon,
                                 &utc.tm_mday,
                                 &utc.tm_hour,
                                 &utc.tm_min,
                                 &utc.tm_sec,
                                 &milliseconds);
  if (fields != 7) return std::nullopt;
  utc.tm_year -= 1900;
  utc.tm_mon -= 1;
  const Milliseconds time(std::int64_t{::timegm(&utc)} * 1000 + milliseconds);
  if (name_of(time) != name) return std::nullopt;
  return time;
}

// After every other one, even if the machine's clock was set back.
std::string next_name(const std::vector<fs::path>& newest_first) {
  auto time =
      std::chrono::duration_cast<Milliseconds>(std::chrono::system_clock::now().time_since_epoch());
  if (!newest_first.empty()) {
    const auto newest = time_of(newest_first.front().filename().string());
    if (newest && *newest >= time) time = *newest + Milliseconds(1);
  }
  return name_of(time);
}

// The regular files of a profile's folder: nobody makes folders in it.
Status copy_files(const fs::path& from, const fs::path& to) {
  std::error_code error;
  for (fs::directory_iterator it(from, error), end; !error && it != end; it.increment(error)) {
    if (!it->is_regular_file(error)) continue;
    fs::copy_file(it->path(), to / it->path().filename(), error);
    if (error) break;
  }
  if (error)
    return fail(Errc::kIo, "copying {} to {}: {}", from.string(), to.string(), error.message());
  return {};
}

}  // namespace

ProfileStore::ProfileStore(fs::path folder, int kept)
    : folder_(folder.lexically_normal()), kept_(kept) {
  VENEER_CHECK(kept >= 1);
  if (!folder_.has_filename()) folder_ = folder_.parent_path();
}

fs::path ProfileStore::history_folder() const {
  fs::path folder = folder_;
  folder += ".history";
  return folder;
}

Result<std::vector<fs::path>> ProfileStore::history() const {
  std::vector<fs::path> entries;
  std::error_code error;
  const fs::path folder = history_folder();
  if (!fs::exists(folder, error) && !error) return entries;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    // Without a manifest it is one that is being removed, or was when somebody was killed.
    std::error_code ignored;
    if (time_of(it->path().filename().string()) && fs::exists(it->path() / kManifest, ignored))
      entries.push_back(it->path());
  }
  if (error)
    return fail(
        Errc::kIo, "listing the older profiles in {}: {}", folder.string(), error.message());
  std::ranges::sort(entries, std::greater<>());
  return entries;
}

// Copies the current profile to the history, unless it cannot be read or is there already (left by
// one who was killed before the new profile took its place).
Status ProfileStore::keep_current() const {
  std::error_code error;
  if (!fs::exists(folder_ / kManifest, error)) return {};
  if (!ProjectorProfile::load(folder_)) return {};
  VENEER_ASSIGN(const std::vector<fs::path> entries, history());
  VENEER_ASSIGN(const std::string manifest, read_text(folder_ / kManifest));
  if (!entries.empty()) {
    const auto newest = read_text(entries.front() / kManifest);
    if (newest && *newest == manifest && ProjectorProfile::load(entries.front())) return {};
  }
  VENEER_ASSIGN(StagedFolder staged, StagedFolder::create(history_folder() / next_name(entries)));
  VENEER_TRY(copy_files(folder_, staged.path()));
  if (const auto copy = ProjectorProfile::load(staged.path()); !copy)
    return fail_while("reading back the copy of the current profile", copy.error());
  return staged.commit();
}

// Nobody is told where this fails: it only tidies up, and the next publish tries again.
void ProfileStore::prune() const {
  const auto entries = history();
  if (!entries) return;
  std::error_code ignored;
  for (std::size_t i = static_cast<std::size_t>(kept_); i < entries->size(); ++i) {
    // The manifest first: what is left of it if we are killed now is no profile any more.
    fs::remove((*entries)[i] / kManifest, ignored);
    fs::remove_all((*entries)[i], ignored);
  }
  std::vector<fs::path> leftovers;
  for (fs::directory_iterator it(history_folder(), ignored), end; !ignored && it != end;
       it.increment(ignored)) {
    std::error_code error;
    if (time_of(it->path().filename().string()) && !fs::exists(it->path() / kManifest, error) &&
        !error)
      leftovers.push_back(it->path());
  }
  for (const fs::path& leftover : leftovers) fs::remove_all(leftover, ignored);
}

Status ProfileStore::publish(const ProjectorProfile& profile, const ExtraFiles& extra) const {
  const std::string doing = fmt::format("publishing the projector profile {}", folder_.string());
  // The profile's own mistakes come before anything is written.
  if (const Status valid = profile.check(); !valid) return fail_while(doing, valid.error());
  if (const Status kept = keep_current(); !kept) return fail_while(doing, kept.error());
  if (const Status saved = profile.save(folder_, extra); !saved)
    return fail_while(doing, saved.error());
  prune();
  return {};
}

Result<fs::path> ProfileStore::roll_back(const fs::path& entry) const {
  const std::string doing = fmt::format("rolling back the projector profile {}", folder_.string());
  VENEER_ASSIGN(const std::vector<fs::path> entries, history());
  fs::path chosen;
  if (!entry.empty()) {
    if (std::ranges::find(entries, entry) == entries.end())
      return fail(Errc::kNotFound, "{}: {} is none of its older profiles", doing, entry.string());
    chosen = entry;
    if (const auto profile = ProjectorProfile::load(chosen); !profile)
      return fail_while(doing, profile.error());
  } else {
    // The one that is current may be the newest in the history too, see keep_current().
    const auto manifest = read_text(folder_ / kManifest);
    const bool current_is_good = ProjectorProfile::load(folder_).has_value();
    const auto good = std::ranges::find_if(entries, [&](const fs::path& candidate) {
      const auto other = read_text(candidate / kManifest);
      const bool same = current_is_good && other && manifest && *other == *manifest;
      return !same && ProjectorProfile::load(candidate);
    });
    if (good == entries.end())
      return fail(Errc::kNotFound,
                  "{}: there is no older profile that can be read; calibrate again",
                  doing);
    chosen = *good;
  }
  // Copied before anything else is touched: keeping the current one could push out the chosen one.
  VENEER_ASSIGN(StagedFolder staged, StagedFolder::create(folder_));
  if (const Status copied = copy_files(chosen, staged.path()); !copied)
    return fail_while(doing, copied.error());
  if (const Status kept = keep_current(); !kept) return fail_while(doing, kept.error());
  if (const Status committed = staged.commit(); !committed)
    return fail_while(doing, committed.error());
  prune();
  return chosen;
}

Result<ProfileStore::Loaded> ProfileStore::load_newest_good() const {
  auto current = ProjectorProfile::load(folder_);
  if (current) return Loaded{std::move(*current), folder_, {}};
  const auto entries = history();
  if (entries) {
    for (const fs::path& entry : *entries) {
      auto older = ProjectorProfile::load(entry);
      if (!older) continue;
      return Loaded{std::move(*older),
                    entry,
                    fmt::format("{}; the older profile {} is used in its place",
                                current.error().what,
                                entry.string())};
    }
  }
  return tl::unexpected<Error>(std::move(current).error());
}

}  // namespace veneer::calibration
