// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/unique_handle.h"
#include "capture/cameras/v4l2/internal_controls.h"

namespace veneer::capture {

/// "YUYV" of V4L2's code; spaces at the end are dropped.
[[nodiscard]] std::string format_name(std::uint32_t code);
/// The code of a name of one to four characters. Errors: kInvalidOption.
[[nodiscard]] Result<std::uint32_t> format_code(std::string_view name);

/// A device node of a camera, open beside whoever streams from it.
class V4l2Node final : public ControlPort {
 public:
  /// Errors: kNotFound, kUnavailable (no permission), kInvalidOption (no capture device).
  [[nodiscard]] static Result<V4l2Node> open(const std::filesystem::path& path);
  int query(std::uint32_t control, v4l2_queryctrl& description) override;
  int read(std::uint32_t control, std::int32_t& value) override;
  int write(std::uint32_t control, std::int32_t value) override;

  [[nodiscard]] const std::string& model() const { return model_; }  ///< and where it is plugged
  [[nodiscard]] std::vector<std::string> formats() const;
  /// What it is set to.
  struct Picture {
    std::string format;
    int width = 0, height = 0;
  };
  [[nodiscard]] Result<Picture> picture() const;
  /// Errors: kUnavailable (another program streams from it: which), kDisconnected, kIo.
  [[nodiscard]] Status check_free() const;
  /// Whether it is still plugged in.
  [[nodiscard]] bool is_there() const;

 private:
  V4l2Node(UniqueFd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}
  /// 0 or errno.
  int call(unsigned long request, void* argument) const;  // NOLINT(google-runtime-int): as ioctl()
  UniqueFd fd_;
  std::filesystem::path path_;
  std::string model_;
};

/// A capture device of this machine.
struct V4l2Device {
  std::filesystem::path node;
  std::string model;
  std::string state;  ///< what stands in the way; empty: nothing seen
};
/// Sorted by number. @param sysfs  for tests.
[[nodiscard]] std::vector<V4l2Device> v4l2_devices(
    const std::filesystem::path& sysfs = "/sys/class/video4linux");

}  // namespace veneer::capture
