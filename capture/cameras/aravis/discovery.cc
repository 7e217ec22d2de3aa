// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "capture/cameras/aravis/internal_discovery.h"

namespace veneer::capture {
namespace {

std::string text_or_empty(const char* text) { return text == nullptr ? "" : text; }

void update_list() {
  arv_disable_interface("Fake");  // Aravis' own, within this program
  arv_update_device_list();
}

/// "; those that answer: A, B".
std::string those_that_answer() {
  std::string text;
  for (const CameraInfo& each : discover_cameras()) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", each.identity);
  }
  return text.empty() ? "none answers" : "those that answer: " + text;
}

constexpr const char* kWhyNot =
    "Is it powered and connected? On Ethernet its address must be of the same network as this "
    "machine's; on USB /etc/udev/rules.d needs etc/udev/60-veneer-cameras.rules";

/// The identity of the camera with that name; empty where there is none.
std::string identity_named(const std::string& name) {
  update_list();
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    for (const char* each : {arv_get_device_id(i),
                             arv_get_device_serial_nbr(i),
                             arv_get_device_physical_id(i),
                             arv_get_device_address(i)}) {
      if (text_or_empty(each) == name) return text_or_empty(arv_get_device_id(i));
    }
  }
  return {};
}

Result<std::string> which(const std::string& name, const std::string& address) {
  if (!address.empty()) return address;
  if (!name.empty()) {
    std::string identity = identity_named(name);
    if (!identity.empty()) return identity;
    return fail(Errc::kNotFound,
                "opening the camera: none is called \"{}\"; {}. {}",
                name,
                those_that_answer(),
                kWhyNot);
  }
  const std::vector<CameraInfo> found = discover_cameras();
  if (found.empty()) {
    return fail(Errc::kNotFound, "opening the camera: no GenICam camera answers. {}", kWhyNot);
  }
  if (found.size() > 1) {
    return fail(Errc::kInvalidOption,
                "opening the camera: there are several; set name to one of {}",
                those_that_answer());
  }
  return found.front().identity;
}

}  // namespace

std::vector<CameraInfo> discover_cameras() {
  update_list();
  std::vector<CameraInfo> found;
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    found.push_back({.driver = "aravis",
                     .model = fmt::format("{} {}, {}",
                                          text_or_empty(arv_get_device_vendor(i)),
                                          text_or_empty(arv_get_device_model(i)),
                                          text_or_empty(arv_get_device_address(i))),
                     .identity = text_or_empty(arv_get_device_id(i)),
                     .state = ""});
  }
  std::ranges::sort(found, {}, &CameraInfo::identity);
  return found;
}

Result<GObjectPtr<ArvCamera>> open_device(const std::string& name, const std::string& address) {
  if (!name.empty() && !address.empty()) {
    return fail(Errc::kInvalidOption,
                "opening the camera: name and address are both set; leave one of them out");
  }
  arv_disable_interface("Fake");
  VENEER_ASSIGN(const std::string identity, which(name, address));
  GlibError error;
  GObjectPtr<ArvCamera> camera(arv_camera_new(identity.c_str(), error.out()));
  if (error || camera == nullptr) {
    if (error.is_device(ARV_DEVICE_ERROR_NOT_FOUND) || !error) {
      return fail(Errc::kNotFound,
                  "opening the camera: nothing answers as {}; {}. {}",
                  identity,
                  those_that_answer(),
                  kWhyNot);
    }
    return fail(Errc::kUnavailable,
                "opening the camera {}: {}. If another program has it (the maker's viewer, "
                "arv-viewer), close that; on USB see etc/udev/60-veneer-cameras.rules",
                identity,
                error.text());
  }
  ArvDevice* device = arv_camera_get_device(camera.get());
  if (ARV_IS_GV_DEVICE(device) && arv_gv_device_is_controller(ARV_GV_DEVICE(device)) == FALSE) {
    return fail(Errc::kUnavailable,
                "opening the camera {}: another program controls it; close that (the maker's "
                "viewer, arv-viewer, another veneer). If it crashed, wait until the camera lets go "
                "of it, three seconds as a rule",
                identity);
  }
  return camera;
}

}  // namespace veneer::capture
