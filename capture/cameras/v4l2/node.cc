// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "capture/cameras/internal_holders.h"
#include "capture/cameras/v4l2/internal_node.h"

namespace veneer::capture {
namespace {

namespace fs = std::filesystem;

std::string text_of_field(const __u8* bytes, std::size_t size) {
  const char* text = reinterpret_cast<const char*>(bytes);
  return {text, ::strnlen(text, size)};
}

std::string seen_devices() {
  std::string text;
  for (const V4l2Device& device : v4l2_devices()) {
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", device.node.string(), device.model);
  }
  return text.empty() ? "there are none" : "there are: " + text;
}

}  // namespace

std::string format_name(std::uint32_t code) {
  std::string name;
  for (int i = 0; i < 4; ++i) name.push_back(static_cast<char>(code >> (8 * i) & 0x7F));
  while (!name.empty() && (name.back() == ' ' || name.back() == '\0')) name.pop_back();
  return name;
}

Result<std::uint32_t> format_code(std::string_view name) {
  const bool printable =
      std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < '\x7F'; });
  if (name.empty() || name.size() > 4 || !printable) {
    return fail(Errc::kInvalidOption,
                "\"{}\" is no pixel format of V4L2, which has names of up to four characters such "
                "as \"YUYV\" or \"Y16\"",
                name);
  }
  std::string padded(name);
  padded.resize(4, ' ');
  return v4l2_fourcc(static_cast<std::uint32_t>(padded[0]),
                     static_cast<std::uint32_t>(padded[1]),
                     static_cast<std::uint32_t>(padded[2]),
                     static_cast<std::uint32_t>(padded[3]));
}

Result<V4l2Node> V4l2Node::open(const fs::path& path) {
  const std::string doing = fmt::format("opening camera {}", path.string());
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (!fd) {
    const int error = errno;
    if (error == ENOENT || error == ENODEV || error == ENXIO || error == ENOTDIR) {
      return fail(Errc::kNotFound, "{}: no camera is there; {}", doing, seen_devices());
    }
    if (error == EACCES || error == EPERM) {
      return fail(Errc::kUnavailable,
                  "{}: no permission; join the group video (`sudo adduser $USER video`), log out "
                  "and in again",
                  doing);
    }
    if (error == EBUSY) {
      const std::string who = text_of(holders_of(path));
      return fail(Errc::kUnavailable,
                  "{}: {}; end that program and try again",
                  doing,
                  who.empty() ? "another program holds it" : who);
    }
    return fail(Errc::kIo, "{}: {}", doing, std::strerror(error));
  }
  V4l2Node node(std::move(fd), path);
  v4l2_capability capability{};
  if (const int error = node.call(VIDIOC_QUERYCAP, &capability); error != 0) {
    return fail(Errc::kInvalidOption,
                "{}: it is no video device ({}); {}",
                doing,
                std::strerror(error),
                seen_devices());
  }
  const auto able = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                          : capability.capabilities;
  if ((able & V4L2_CAP_VIDEO_CAPTURE) == 0 || (able & V4L2_CAP_STREAMING) == 0) {
    return fail(Errc::kInvalidOption,
                "{}: it gives no pictures (a webcam has a second node for its metadata); {}",
                doing,
                seen_devices());
  }
  node.model_ = fmt::format("{} at {}",
                            text_of_field(capability.card, sizeof capability.card),
                            text_of_field(capability.bus_info, sizeof capability.bus_info));
  return node;
}

int V4l2Node::call(unsigned long request, void* argument) const {  // NOLINT(google-runtime-int)
  int result = 0;
  do {
    result = ::ioctl(fd_.value(), request, argument);
  } while (result == -1 && errno == EINTR);
  return result == -1 ? errno : 0;
}

int V4l2Node::query(std::uint32_t control, v4l2_queryctrl& description) {
  description.id = control;
  return call(VIDIOC_QUERYCTRL, &description);
}

int V4l2Node::read(std::uint32_t control, std::int32_t& value) {
  v4l2_control one{control, 0};
  const int error = call(VIDIOC_G_CTRL, &one);
  value = one.value;
  return error;
}

int V4l2Node::write(std::uint32_t control, std::int32_t value) {
  v4l2_control one{control, value};
  return call(VIDIOC_S_CTRL, &one);
}

std::vector<std::string> V4l2Node::formats() const {
  std::vector<std::string> names;
  v4l2_fmtdesc description{};
  description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  while (call(VIDIOC_ENUM_FMT, &description) == 0) {
    names.push_back(format_name(description.pixelformat));
    ++description.index;
  }
  return names;
}

Result<V4l2Node::Picture> V4l2Node::picture() const {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int error = call(VIDIOC_G_FMT, &format); error != 0) {
    return control_failed(fmt::format("reading the format of {}", path_.string()), error);
  }
  return Picture{format_name(format.fmt.pix.pixelformat),
                 static_cast<int>(format.fmt.pix.width),
                 static_cast<int>(format.fmt.pix.height)};
}

Status V4l2Node::check_free() const {
  // Whoever has buffers has the camera: so ask for one, and give it back.
  v4l2_requestbuffers buffers{};
  buffers.count = 1;
  buffers.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffers.memory = V4L2_MEMORY_MMAP;
  const std::string doing = fmt::format("opening camera {}", path_.string());
  const int error = call(VIDIOC_REQBUFS, &buffers);
  if (error == EBUSY) {
    const std::string who = text_of(holders_of(path_));
    return fail(Errc::kUnavailable,
                "{}: {}; end that program and try again",
                doing,
                who.empty() ? "it is in use, in this program or in one of another user" : who);
  }
  if (error != 0) return control_failed(doing, error);
  buffers.count = 0;
  call(VIDIOC_REQBUFS, &buffers);
  return {};
}

bool V4l2Node::is_there() const {
  v4l2_capability capability{};
  const int error = call(VIDIOC_QUERYCAP, &capability);
  return error != ENODEV && error != ENXIO;
}

std::vector<V4l2Device> v4l2_devices(const fs::path& sysfs) {
  std::vector<V4l2Device> devices;
  std::error_code gone;
  for (fs::directory_iterator entry(sysfs, gone), end; !gone && entry != end;
       entry.increment(gone)) {
    V4l2Device device;
    device.node = fs::path("/dev") / entry->path().filename();
    std::ifstream name(entry->path() / "name");
    std::getline(name, device.model);
    if (!entry->path().filename().string().starts_with("video")) continue;
    const UniqueFd fd(::open(device.node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    if (!fd) {
      if (errno == ENOENT || errno == ENODEV || errno == ENXIO) continue;
      device.state = errno == EACCES ? "no permission: join the group video" : std::strerror(errno);
      devices.push_back(std::move(device));
      continue;
    }
    v4l2_capability capability{};
    if (::ioctl(fd.value(), VIDIOC_QUERYCAP, &capability) != 0 ||
        (capability.device_caps & V4L2_CAP_VIDEO_CAPTURE) == 0) {
      continue;
    }
    device.state = text_of(holders_of(device.node));
    devices.push_back(std::move(device));
  }
  std::sort(devices.begin(), devices.end(), [](const V4l2Device& a, const V4l2Device& b) {
    const auto number = [](const V4l2Device& device) {
      return std::atoi(device.node.filename().string().c_str() + std::strlen("video"));
    };
    return number(a) < number(b);
  });
  return devices;
}

}  // namespace veneer::capture
