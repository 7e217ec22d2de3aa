// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/image.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/output.h"

namespace veneer::projector {

/// Where frames are written and which; keys of the [output] table.
struct FileOutputOptions {
  /// Made where it is missing; relative to the configuration file.
  std::filesystem::path folder;
  /// Writes the frames whose number is a multiple of this. >= 1.
  std::uint64_t every = 1;
  /// Also writes the luminance target of each such frame.
  bool target = false;
  [[nodiscard]] Status check() const;
};

/// Writes frames as files, by a thread of its own:
///
///   frame-000123.png   the drive codes: of 8 bits as an 8-bit PNG, code for code; of n bits
///   otherwise
///                      as a 16-bit PNG, the code times 65535 / (2^n - 1), rounded, so that full
///                      drive is full scale at any depth (undone by value * (2^n - 1) / 65535,
///                      rounded)
///   target-000123.exr  XYZ in cd/m^2, channels X, Y, Z
///   frames.jsonl       one line a written frame, in the order of presentation:
///                      {"frame":123,"display_time_ns":..,"file":"frame-000123.png"}, with
///                      "target":"target-000123.exr" where there is one
///
/// The index of an earlier run is replaced when the first frame is written, not before: a run that
/// fails on its way there leaves what it found. Each picture is there whole or not at all, and its
/// line follows it. present() copies the frame
/// and returns; it waits only while four frames are queued. An error of the writing thread is
/// returned by the next present() or finish() and all that follow; what is queued behind it is
/// dropped.
class FileOutput final : public Output {
 public:
  /// Errors: kInvalidOption, kIo (the folder cannot be made or written to).
  [[nodiscard]] static Result<std::unique_ptr<FileOutput>> open(TomlReader& config);
  ~FileOutput() override;

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] bool wants_pixels(std::uint64_t frame_number) const override {
    return frame_number % options_.every == 0;
  }
  [[nodiscard]] bool wants_target(std::uint64_t frame_number) const override {
    return options_.target && wants_pixels(frame_number);
  }
  /// Errors: kIo; kBadFormat for a wanted frame without pixels or target, of no 1 to 16 bits or
  /// with a code that has more bits.
  [[nodiscard]] Status present(const Frame& frame) override;
  [[nodiscard]] Status finish() override;
  [[nodiscard]] std::uint64_t waits() const override { return waits_; }

 private:
  /// A frame of our own. Memory is kept from frame to frame.
  struct Job {
    std::uint64_t number = 0;
    int bits = 0;
    Time display_time;
    Image<Rgb16> codes;
    Image<Rgb32f> target;
  };
  static constexpr std::size_t kQueueLength = 4;

  explicit FileOutput(FileOutputOptions options);
  void run_writer();
  [[nodiscard]] Status write(const Job& job);
  [[nodiscard]] Status write_codes(const std::filesystem::path& path, const Job& job);

  FileOutputOptions options_;
  std::uint64_t waits_ = 0;
  // The writing thread's own.
  std::ofstream index_;  // open from the first frame on
  Image<Rgb8> scratch8_;
  Image<Rgb16> scratch16_;

  // Guards what follows, but not the insides of jobs: the job behind the last queued one belongs to
  // present(), the first queued one to the writing thread.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::array<Job, kQueueLength> jobs_;  // a ring
  std::size_t first_ = 0;
  std::size_t queued_ = 0;
  bool stop_ = false;
  std::optional<Error> error_;
  std::thread writer_;
};

}  // namespace veneer::projector
