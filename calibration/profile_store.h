// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// A profile's folder and those that stood there before it.
///
/// NAME is the current profile; NAME.history/<UTC time>/ are older ones, named after the moment
/// they were replaced. What is replaced is first copied to the history, read back, and only then
/// does the new folder take its name: whenever the program or the machine stops, the old profile or
/// the new one stands there whole. (Where a file system cannot exchange two names there is a moment
/// without either; the copy is in the history by then.) Any number of programs may read; of two
/// that publish at a time the later one wins.
class ProfileStore {
 public:
  static constexpr int kKept = 10;

  /// @param folder  NAME; need not be there yet.   @param kept  older profiles that are kept, >= 1
  /// (checked).
  explicit ProfileStore(std::filesystem::path folder, int kept = kKept);

  /// Makes `profile` the current one, with the further files that `extra` writes. One that is there
  /// but damaged is replaced without being kept.
  /// Errors: kBadFormat (the profile's check), kIo (a full disk); the old one stays.
  [[nodiscard]] Status publish(const ProjectorProfile& profile, const ExtraFiles& extra = {}) const;

  /// The folders of older profiles, newest first. Errors: kIo.
  [[nodiscard]] Result<std::vector<std::filesystem::path>> history() const;

  /// Makes an older profile the current one again, all its files included; the current one is kept
  /// in the history, so that rolling back twice changes nothing.
  /// @param entry  one of history(); empty: the newest that can be read.   Returns which it was.
  /// Errors: kNotFound (no such entry, or none that can be read), kBadFormat, kIo.
  [[nodiscard]] Result<std::filesystem::path> roll_back(
      const std::filesystem::path& entry = {}) const;

  struct Loaded {
    ProjectorProfile profile;
    std::filesystem::path from;  ///< the folder that it was read from
    std::string warning;         ///< empty for the current one; else why an older one was taken
  };
  /// The current profile, or the newest older one that can be read.
  /// Errors: those of loading the current one.
  [[nodiscard]] Result<Loaded> load_newest_good() const;

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  [[nodiscard]] std::filesystem::path history_folder() const;
  [[nodiscard]] Status keep_current() const;
  void prune() const;

  std::filesystem::path folder_;
  int kept_;
};

}  // namespace veneer::calibration
