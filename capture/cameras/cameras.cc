// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/cameras.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "capture/cameras/aravis/aravis_camera.h"
#include "capture/cameras/folder/folder_camera.h"
#include "capture/cameras/gphoto2/gphoto2_camera.h"
#include "capture/cameras/v4l2/v4l2_camera.h"

namespace veneer::capture {
namespace {

template <class T>
Result<std::unique_ptr<Camera>> open_as_camera(TomlReader& config) {
  return T::open(config);
}

constexpr std::array kCameras{
    CameraDriver{"aravis",
                 "GenICam cameras over Ethernet and USB3",
                 &open_as_camera<AravisCamera>,
                 &AravisCamera::list},
    CameraDriver{"folder",
                 "pictures on disk, of a RAW-converted series for example",
                 &open_as_camera<FolderCamera>,
                 &FolderCamera::list},
    CameraDriver{"gphoto2", "DSLR and mirrorless cameras", &open_gphoto2, &list_gphoto2},
    CameraDriver{"v4l2", "webcams", &open_v4l2, &list_v4l2},
};
static_assert(std::ranges::is_sorted(kCameras, {}, &CameraDriver::name));

constexpr std::array<std::pair<std::string_view, Trigger>, 3> kTriggers{{
    {"free", Trigger::kFree},
    {"software", Trigger::kSoftware},
    {"hardware", Trigger::kHardware},
}};

Status set_common(TomlReader& config, Camera& camera) {
  if (config.contains("pixel_format")) {
    std::string format;
    config.read("pixel_format", format);
    VENEER_TRY(camera.set_pixel_format(format));
  }
  if (config.contains("gain_db")) {
    double gain = 0;
    config.read("gain_db", gain);
    VENEER_TRY(camera.set_gain_db(gain));
  }
  if (config.contains("trigger")) {
    std::string name;
    config.read("trigger", name);
    const auto trigger =
        std::ranges::find(kTriggers, name, &std::pair<std::string_view, Trigger>::first);
    if (trigger == kTriggers.end()) {
      return fail(Errc::kInvalidOption,
                  "there is no trigger \"{}\"; set trigger to \"free\", \"software\" or "
                  "\"hardware\"",
                  name);
    }
    VENEER_TRY(camera.set_trigger(trigger->second));
  }
  if (config.contains("exposure_s")) {
    double exposure_s = 0;
    config.read("exposure_s", exposure_s);
    VENEER_TRY(camera.set_exposure(exposure_s));
  }
  return {};
}

}  // namespace

std::span<const CameraDriver> camera_drivers() { return kCameras; }

Result<std::unique_ptr<Camera>> open_camera(TomlReader& config) {
  std::string name;
  config.read("driver", name);
  const auto driver = std::ranges::find(kCameras, name, &CameraDriver::name);
  if (driver == kCameras.end()) {
    std::string known;
    for (const CameraDriver& each : kCameras) known += fmt::format(" \"{}\"", each.name);
    return fail(
        Errc::kInvalidOption,
        "opening the camera: {}; set driver in [camera] to one of{}",
        name.empty() ? "no driver is named" : fmt::format("no driver is called \"{}\"", name),
        known);
  }
  VENEER_ASSIGN(std::unique_ptr<Camera> camera, driver->open(config));
  if (const Status set = set_common(config, *camera); !set) {
    return fail_while("opening the camera", set.error());
  }
  return camera;
}

CameraList list_cameras() {
  CameraList list;
  for (const CameraDriver& driver : kCameras) {
    auto found = driver.list();
    if (found) {
      std::ranges::move(*found, std::back_inserter(list.found));
    } else {
      list.failed.push_back({driver.name, std::move(found).error()});
    }
  }
  return list;
}

}  // namespace veneer::capture
