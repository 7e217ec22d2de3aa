// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "base/unique_handle.h"

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

/// "NAME.XXXXXX.tmp" beside `path`, so that the rename stays within one file system.
std::string staging_template(const fs::path& path) {
  fs::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return (clean.parent_path() / ("." + clean.filename().string() + ".XXXXXX")).string();
}

/// Makes what was written to `path` (a file or a folder) outlive a power failure.
Status sync_path(const fs::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd || ::fsync(fd.value()) != 0) {
    return fail(Errc::kIo, "writing {} to disk: {}", path.string(), system_message(errno));
  }
  return {};
}

Status sync_parent(const fs::path& path) {
  return sync_path(path.has_parent_path() ? path.parent_path() : fs::path("."));
}

}  // namespace

Result<std::string> read_text(const fs::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) {
    const Errc code = errno == ENOENT ? Errc::kNotFound : Errc::kIo;
    return fail(code, "reading {}: {}", path.string(), system_message(errno));
  }
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
  std::string name = staging_template(final_path);
  const UniqueFd fd(::mkostemp(name.data(), O_CLOEXEC));
  if (!fd) {
    return fail(Errc::kIo, "writing {}: {}", final_path.string(), system_message(errno));
  }
  ::fchmod(fd.value(), 0644);  // mkostemp makes files private; a result is for everyone to read
  return StagedFile(final_path, name);
}

StagedFile::StagedFile(StagedFile&& other) noexcept
    : final_(std::move(other.final_)), staging_(std::move(other.staging_)) {
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
  return sync_parent(final_);
}

Result<StagedFolder> StagedFolder::create(const fs::path& final_path) {
  VENEER_TRY(make_parent(final_path));
  std::string name = staging_template(final_path);
  if (::mkdtemp(name.data()) == nullptr) {
    return fail(Errc::kIo, "writing {}: {}", final_path.string(), system_message(errno));
  }
  std::error_code ignored;
  fs::permissions(name, fs::perms(0755), ignored);
  return StagedFolder(final_path, name);
}

StagedFolder::StagedFolder(StagedFolder&& other) noexcept
    : final_(std::move(other.final_)), staging_(std::move(other.staging_)) {
  other.staging_.clear();
}

StagedFolder::~StagedFolder() {
  if (staging_.empty()) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

Status StagedFolder::commit() {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(staging_, error)) {
    if (entry.is_regular_file()) VENEER_TRY(sync_path(entry.path()));
  }
  // A folder cannot be renamed over one that holds files: move the old one aside first.
  fs::path target = final_.lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  fs::path old;
  if (fs::exists(target, error)) {
    if (!fs::is_directory(target, error)) {
      return fail(
          Errc::kIo, "writing the folder {}: a file of that name is in the way", target.string());
    }
    old = staging_;
    old += ".old";
    fs::rename(target, old, error);
    if (error) return fail(Errc::kIo, "replacing {}: {}", target.string(), error.message());
  }
  fs::rename(staging_, target, error);
  if (error) {
    const std::string why = error.message();
    if (!old.empty()) fs::rename(old, target, error);  // put the last good one back
    return fail(Errc::kIo, "writing the folder {}: {}", target.string(), why);
  }
  staging_.clear();
  if (!old.empty()) fs::remove_all(old, error);
  return sync_parent(target);
}

}  // namespace veneer
