// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer {

[[nodiscard]] Result<std::string> read_text(const std::filesystem::path& path);

/// Replaces `path` by `text` whole or not at all: temporary file beside it, fsync, rename. Makes
/// missing folders. Errors: kIo.
[[nodiscard]] Status write_text(const std::filesystem::path& path, std::string_view text);

/// A file that is being written beside its final place. commit() puts it there; without it the
/// destructor removes what was written. What a killed program left of the same name is removed by
/// the next create(): it is no longer locked.
class StagedFile {
 public:
  [[nodiscard]] static Result<StagedFile> create(const std::filesystem::path& final_path);
  StagedFile(StagedFile&& other) noexcept;
  StagedFile& operator=(StagedFile&& other) = delete;
  ~StagedFile();
  /// Where to write; an existing empty file.
  [[nodiscard]] const std::filesystem::path& path() const { return staging_; }
  [[nodiscard]] Status commit();

 private:
  StagedFile(std::filesystem::path final_path, std::filesystem::path staging, UniqueFd lock)
      : final_(std::move(final_path)), staging_(std::move(staging)), lock_(std::move(lock)) {}
  std::filesystem::path final_;
  std::filesystem::path staging_;  // empty when there is nothing to remove
  UniqueFd lock_;                  // of what is staged: says that its owner lives
};

/// The same for a folder of files. commit() replaces an older folder of that name; where the file
/// system can exchange two names, one of both stands there at any time.
class StagedFolder {
 public:
  [[nodiscard]] static Result<StagedFolder> create(const std::filesystem::path& final_path);
  StagedFolder(StagedFolder&& other) noexcept;
  StagedFolder& operator=(StagedFolder&& other) = delete;
  ~StagedFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return staging_; }
  [[nodiscard]] Status commit();

 private:
  StagedFolder(std::filesystem::path final_path, std::filesystem::path staging, UniqueFd lock)
      : final_(std::move(final_path)), staging_(std::move(staging)), lock_(std::move(lock)) {}
  std::filesystem::path final_;
  std::filesystem::path staging_;  // empty when there is nothing to remove
  UniqueFd lock_;                  // of what is staged: says that its owner lives
};

}  // namespace veneer
