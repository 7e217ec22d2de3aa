// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "base/result.h"
#include "base/unique_handle.h"
#include "tracking/pose.h"

namespace veneer::tracking {

/// Records pose samples as JSON lines: a header {"format":"veneer-poses","version":1}, then one
/// sample a line, in the order of arrival:
/// {"t_ns":..,"body":..,"seq":..,"p":[x,y,z],"q":[w,x,y,z]}.
///
/// Every line reaches the system in one write, so that a program that is killed leaves at most one
/// truncated line, the last. Finite numbers come back bit for bit; NaN and infinities (which a
/// faulty device may have sent) are written as null and come back as NaN.
class PoseRecorder {
 public:
  /// Begins a recording; an older file of that name is replaced, missing folders are made.
  /// Errors: kIo.
  [[nodiscard]] static Result<PoseRecorder> create(const std::filesystem::path& path);
  /// Errors: kIo.
  [[nodiscard]] Status write(const PoseSample& sample);

 private:
  PoseRecorder(std::filesystem::path path, UniqueFd file)
      : path_(std::move(path)), file_(std::move(file)) {}
  [[nodiscard]] Status write_line(const std::string& line);
  std::filesystem::path path_;
  UniqueFd file_;
};

/// Reads a recording sample by sample; a day's recording need not fit into memory.
class PoseRecordingReader {
 public:
  /// Errors: kNotFound, kBadFormat (no header, a format or version this program does not know).
  [[nodiscard]] static Result<PoseRecordingReader> open(const std::filesystem::path& path);
  /// The next sample; nothing at the end.
  /// Errors: kBadFormat, which names the line. A last line that was cut short is no error.
  [[nodiscard]] Result<std::optional<PoseSample>> next();
  /// Whether the end was reached and the last line had been cut short (the recorder was killed).
  [[nodiscard]] bool truncated() const { return truncated_; }

 private:
  PoseRecordingReader(std::filesystem::path path, std::ifstream file)
      : path_(std::move(path)), file_(std::move(file)) {}
  /// Whether there was a line; sets `ended_` where it has no line end.
  bool read_line();
  std::filesystem::path path_;
  std::ifstream file_;
  std::string line_;
  int line_number_ = 0;
  bool ended_ = false;
  bool truncated_ = false;
};

}  // namespace veneer::tracking
