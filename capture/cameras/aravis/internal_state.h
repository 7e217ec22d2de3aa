// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "capture/cameras/aravis/aravis_camera.h"
#include "capture/cameras/aravis/internal_glib.h"
#include "capture/cameras/aravis/internal_options.h"
#include "capture/cameras/aravis/pixel_format.h"

namespace veneer::capture {

/// An open camera: aravis_camera.cc grabs its pictures, settings.cc opens it and sets it up.
struct AravisCamera::State {
  // Set by the thread of the heartbeat, too, which ends with the camera: so it lives longer.
  std::atomic<bool> lost{false};
  GObjectPtr<ArvCamera> camera;
  GObjectPtr<ArvStream> stream;  // made anew for each pixel format
  AravisOptions options;
  std::string description;
  std::string format_name;
  PixelFormat format;
  int width = 0, height = 0;
  double exposure_s = 0;
  Trigger trigger = Trigger::kFree;
  bool single_frame = false;
  std::uint64_t last_id = 0, sequence = 0;
  gulong lost_handler = 0;

  ~State() {
    if (camera == nullptr) return;
    if (lost_handler != 0) {
      g_signal_handler_disconnect(arv_camera_get_device(camera.get()), lost_handler);
    }
  }

  static void on_control_lost(ArvDevice* /*device*/, void* state) {
    static_cast<State*>(state)->lost = true;
  }

  tl::unexpected<Error> disconnected() const {
    return fail(Errc::kDisconnected,
                "{}: it does not answer any more; see to its cable and power, then open it again",
                description);
  }
  /// What an error of Aravis means for who called.
  tl::unexpected<Error> failed(std::string_view doing, const GlibError& error) {
    if (error.is_device(ARV_DEVICE_ERROR_NOT_CONTROLLER) ||
        error.is_device(ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED)) {
      return fail(Errc::kUnavailable,
                  "{}: {}: another program controls it; close that",
                  description,
                  doing);
    }
    // Aravis has asked several times, over seconds, before it says so.
    if (lost || error.is_device(ARV_DEVICE_ERROR_TIMEOUT) ||
        error.is_device(ARV_DEVICE_ERROR_NOT_CONNECTED) ||
        error.is_device(ARV_DEVICE_ERROR_TRANSFER_ERROR)) {
      lost = true;
      return disconnected();
    }
    return fail(Errc::kIo, "{}: {}: {}", description, doing, error.text());
  }

  [[nodiscard]] bool has(const char* feature) {
    GlibError error;
    const bool available =
        arv_camera_is_feature_available(camera.get(), feature, error.out()) != FALSE;
    return available && !error;
  }
  [[nodiscard]] bool is_ethernet() const { return arv_camera_is_gv_device(camera.get()) != FALSE; }

  Status start(const AravisOptions& wanted);
  Status switch_off_automatics();
  Status set_packets();
  Status set_raw_gain(int steps);
  [[nodiscard]] std::vector<std::string> formats();
  Status choose_format(const std::string& name);
  Status make_stream();
  Result<CameraFrame> wait_for_picture();
  Result<CameraFrame> frame_of(ArvBuffer* buffer, Time call);
  tl::unexpected<Error> damaged(ArvBuffer* buffer);
  tl::unexpected<Error> nothing_came();
};

}  // namespace veneer::capture
