// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <system_error>
#include <vector>

namespace veneer {
namespace {

namespace fs = std::filesystem;

std::string system_message(int error) {
  return std::error_code(error, std::generic_category()).message();
}

Status make_parent(const fs::path& path) {
  const fs::path parent = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::error_code error;
  fs::create_directories(parent, error);
  if (error) {
    return fail(Errc::kIo, "making the folder {}: {}", parent.string(), error.message());
  }
  return {};
}

/// `path` without dots and without a slash at its end.
fs::path clean_path(const fs::path& path) {
  fs::path clean = path.lexically_normal();
  return clean.has_filename() ? clean : clean.parent_path();
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

/// The names under which `path` is staged start so; kRandom follows.
std::string staging_prefix(const fs::path& path) {
  return "." + clean_path(path).filename().string() + ".veneer-";
}
constexpr std::string_view kRandom = "XXXXXX";  // what mkostemp and mkdtemp replace

/// ".NAME.veneer-XXXXXX" beside `path`, so that the rename stays within one file system.
std::string staging_template(const fs::path& path) {
  return (clean_path(path).parent_path() / (staging_prefix(path) + std::string(kRandom))).string();
}

/// Opens and locks what is staged at `path`; the system lets go of the lock when its owner ends,
/// however it ends. Empty where another holds the lock or the file system knows none.
UniqueFd lock_staged(const fs::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (fd && ::flock(fd.value(), LOCK_EX | LOCK_NB) != 0) fd.reset();
  return fd;
}

/// Removes what killed programs left of `path`. Nobody is told where that fails: it only tidies up.
void remove_stale(const fs::path& path) {
  // Something younger may have been made just now and not be locked yet.
  constexpr std::chrono::minutes kYoungest{1};
  const std::string prefix = staging_prefix(path);
  std::error_code error;
  std::vector<fs::path> staged;
  for (fs::directory_iterator it(folder_of(clean_path(path)), error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() == prefix.size() + kRandom.size() && name.starts_with(prefix))
      staged.push_back(it->path());
  }
  for (const fs::path& candidate : staged) {
    const fs::file_time_type written = fs::last_write_time(candidate, error);
    if (error || fs::file_time_type::clock::now() - written < kYoungest) continue;
    const UniqueFd lock = lock_staged(candidate);
    if (lock) fs::remove_all(candidate, error);
  }
}

/// Makes what was written to `path` (a file or a folder) outlive a power failure.
Status sync_path(const fs::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd || ::fsync(fd.value()) != 0) {
    return fail(Errc::kIo, "writing {} to disk: {}", path.string(), system_message(errno));
  }
  return {};
}

Status sync_parent(const fs::path& path) { return sync_path(folder_of(path)); }

/// Puts the folder `staged` in the place of the folder `target` and the old one in the place of
/// `staged`.
Status exchange_folders(const fs::path& staged, const fs::path& target) {
  if (::renameat2(AT_FDCWD, staged.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0)
    return {};
  std::error_code error(errno, std::generic_category());
  if (error.value() == EINVAL || error.value() == ENOSYS) {
    // This file system cannot exchange, and a folder cannot be renamed over one that holds files.
    fs::path old = staged;
    old += ".old";
    fs::rename(target, old, error);
    if (!error) {
      std::error_code ignored;
      fs::rename(staged, target, error);
      fs::rename(old, error ? target : staged, ignored);  // on an error, put the last good one back
    }
  }
  if (error) return fail(Errc::kIo, "replacing {}: {}", target.string(), error.message());
  return {};
}

}  // namespace

Result<std::string> read_text(const fs::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) {
    const Errc code = errno == ENOENT ? Errc::kNotFound : Errc::kIo;
    return fail(code, "reading {}: {}", path.string(), system_message(errno));
  }
  // Without an end, as /dev/zero has none, a text would take all memory there is.
  struct stat info {};
  if (::fstat(fd.value(), &info) == 0 && (S_ISCHR(info.st_mode) || S_ISBLK(info.st_mode)))
    return fail(Errc::kIo, "reading {}: it is a device; name a file", path.string());
  std::string text;
  std::array<char, 65536> buffer;
  for (;;) {
    const ssize_t count = ::read(fd.value(), buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return fail(Errc::kIo, "reading {}: {}", path.string(), system_message(errno));
    if (count == 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

Status write_text(const fs::path& path, std::string_view text) {
  VENEER_ASSIGN(StagedFile staged, StagedFile::create(path));
  {
    const UniqueFd fd(::open(staged.path().c_str(), O_WRONLY | O_CLOEXEC));
    if (!fd) return fail(Errc::kIo, "writing {}: {}", path.string(), system_message(errno));
    while (!text.empty()) {
      const ssize_t count = ::write(fd.value(), text.data(), text.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return fail(Errc::kIo, "writing {}: {}", path.string(), system_message(errno));
      text.remove_prefix(static_cast<std::size_t>(count));
    }
  }
  return staged.commit();
}

Result<StagedFile> StagedFile::create(const fs::path& final_path) {
  VENEER_TRY(make_parent(final_path));
  remove_stale(final_path);
  std::string name = staging_template(final_path);
  const UniqueFd fd(::mkostemp(name.data(), O_CLOEXEC));
  if (!fd) {
    return fail(Errc::kIo, "writing {}: {}", final_path.string(), system_message(errno));
  }
  ::fchmod(fd.value(), 0644);  // mkostemp makes files private; a result is for everyone to read
  return StagedFile(final_path, name, lock_staged(name));
}

StagedFile::StagedFile(StagedFile&& other) noexcept
    : final_(std::move(other.final_)),
      staging_(std::move(other.staging_)),
      lock_(std::move(other.lock_)) {
  other.staging_.clear();
}

StagedFile::~StagedFile() {
  if (staging_.empty()) return;
  std::error_code ignored;
  fs::remove(staging_, ignored);
}

Status StagedFile::commit() {
  VENEER_TRY(sync_path(staging_));
  std::error_code error;
  fs::rename(staging_, final_, error);
  if (error) return fail(Errc::kIo, "writing {}: {}", final_.string(), error.message());
  staging_.clear();
  lock_.reset();
  return sync_parent(final_);
}

Result<StagedFolder> StagedFolder::create(const fs::path& final_path) {
  VENEER_TRY(make_parent(final_path));
  remove_stale(final_path);
  std::string name = staging_template(final_path);
  if (::mkdtemp(name.data()) == nullptr) {
    return fail(Errc::kIo, "writing {}: {}", final_path.string(), system_message(errno));
  }
  std::error_code ignored;
  fs::permissions(name, fs::perms(0755), ignored);
  return StagedFolder(final_path, name, lock_staged(name));
}

StagedFolder::StagedFolder(StagedFolder&& other) noexcept
    : final_(std::move(other.final_)),
      staging_(std::move(other.staging_)),
      lock_(std::move(other.lock_)) {
  other.staging_.clear();
}

StagedFolder::~StagedFolder() {
  if (staging_.empty()) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

Status StagedFolder::commit() {
  std::error_code error;
  for (fs::directory_iterator it(staging_, error), end; !error && it != end; it.increment(error)) {
    if (it->is_regular_file(error)) VENEER_TRY(sync_path(it->path()));
    if (error) break;
  }
  if (error) return fail(Errc::kIo, "writing {}: {}", staging_.string(), error.message());
  VENEER_TRY(sync_path(staging_));  // the names in it
  const fs::path target = clean_path(final_);
  if (!fs::exists(target, error)) {
    fs::rename(staging_, target, error);
    if (error)
      return fail(Errc::kIo, "writing the folder {}: {}", target.string(), error.message());
    staging_.clear();
    lock_.reset();
    return sync_parent(target);
  }
  if (!fs::is_directory(target, error)) {
    return fail(
        Errc::kIo, "writing the folder {}: a file of that name is in the way", target.string());
  }
  VENEER_TRY(exchange_folders(staging_, target));
  Status status = sync_parent(target);
  fs::remove_all(staging_, error);  // the old one; only after the new one is sure to stay
  staging_.clear();
  lock_.reset();
  return status;
}

}  // namespace veneer
