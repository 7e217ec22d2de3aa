// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/aravis/aravis_camera.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "capture/cameras/aravis/internal_state.h"

namespace veneer::capture {
namespace {

constexpr auto kPollUs = std::uint64_t{50'000};  // how soon a lost camera is noticed

}  // namespace

tl::unexpected<Error> AravisCamera::State::damaged(ArvBuffer* buffer) {
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (!is_ethernet()) {
    return fail(
        Errc::kBadFormat,
        "{}: a picture came damaged over USB (status {}); grab again. If it goes on: another "
        "cable, a socket of its own, and usbcore.usbfs_memory_mb above 16",
        description,
        static_cast<int>(status));
  }
  guint64 resent = 0;
  guint64 missing = 0;
  arv_gv_stream_get_statistics(ARV_GV_STREAM(stream.get()), &resent, &missing);
  if (status == ARV_BUFFER_STATUS_SIZE_MISMATCH) {
    return fail(Errc::kBadFormat,
                "{}: a picture was larger than its format says; open the camera again",
                description);
  }
  return fail(
      Errc::kBadFormat,
      "{}: a picture came without all of its packets ({} missing and {} sent again since the "
      "format was set); grab again. If it goes on: let the network card take jumbo frames (ip "
      "link set DEVICE mtu 9000) and set packet_size = 8192, enlarge the receive buffer "
      "(sysctl net.core.rmem_max=33554432), or set packet_delay_us = 10 and more",
      description,
      missing,
      resent);
}

tl::unexpected<Error> AravisCamera::State::nothing_came() {
  if (lost) return disconnected();
  if (trigger == Trigger::kHardware) {
    return fail(
        Errc::kTimeout,
        "{}: no signal came at its input within {} s; see to the cable, the line and its edge "
        "(TriggerSource, TriggerActivation), or set timeout_s higher",
        description,
        options.timeout_s);
  }
  return fail(Errc::kTimeout,
              "{}: no picture came within {} s and the exposure; try again. If it goes on: {}",
              description,
              options.timeout_s,
              is_ethernet()
                  ? "a firewall may drop the stream (UDP), or packet_size be above the MTU "
                    "of the network"
                  : "see to the cable, or set timeout_s higher");
}

Result<CameraFrame> AravisCamera::State::frame_of(ArvBuffer* buffer, Time call) {
  std::size_t size = 0;
  const void* data = arv_buffer_get_image_data(buffer, &size);
  gint x_padding = 0;
  gint y_padding = 0;
  arv_buffer_get_image_padding(buffer, &x_padding, &y_padding);
  const std::span bytes(static_cast<const std::byte*>(data), data == nullptr ? 0 : size);
  auto counts = counts_of(bytes, format, width, height, x_padding);
  if (!counts) return fail_while(description, counts.error());

  CameraFrame frame;
  frame.counts = std::move(*counts);
  frame.full_scale = options.full_scale != 0 ? static_cast<std::uint16_t>(options.full_scale)
                                             : format.full_scale();
  frame.exposure_s = exposure_s;
  frame.mosaic = format.mosaic;
  // Aravis says when the first bytes came in the time of day; from now backwards it is the same.
  const Time now = SteadyClock().now();
  const Duration ago{g_get_real_time() * 1000 -
                     static_cast<std::int64_t>(arv_buffer_get_system_timestamp(buffer))};
  const Duration half = from_seconds(0.5 * exposure_s);
  frame.time = std::clamp(now - ago - half, std::min(call + half, now), now);
  const std::uint64_t id = arv_buffer_get_frame_id(buffer);
  sequence += id > last_id ? id - last_id : 1;  // cameras begin anew with each start, or at 65536
  last_id = id;
  frame.sequence = sequence;
  return frame;
}

Result<CameraFrame> AravisCamera::State::wait_for_picture() {
  // Whatever came after the last stop.
  while (ArvBuffer* old = arv_stream_try_pop_buffer(stream.get())) {
    arv_stream_push_buffer(stream.get(), old);
  }
  const Time call = SteadyClock().now();
  GlibError error;
  arv_camera_start_acquisition(camera.get(), error.out());
  if (error) return failed("starting a picture", error);
  if (trigger == Trigger::kSoftware) {
    arv_camera_software_trigger(camera.get(), error.out());
    if (error) return failed("triggering", error);
  }
  // No picture that began after the call is complete before it was exposed: one that is was still
  // on its way from before. (Nine tenths, for the device may round the exposure down.)
  const Time earliest = call + from_seconds(0.9 * exposure_s);
  const Time deadline = call + from_seconds(exposure_s + options.timeout_s);
  // Where the camera cannot take single pictures, one may have begun just before it was stopped.
  int to_skip = single_frame ? 0 : 1;
  while (SteadyClock().now() < deadline && !lost) {
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream.get(), kPollUs);
    if (buffer == nullptr) continue;
    const bool stale = SteadyClock().now() < earliest || to_skip-- > 0;
    std::optional<Result<CameraFrame>> result;
    if (!stale) {
      if (arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS) {
        result = frame_of(buffer, call);
      } else {
        result = damaged(buffer);
      }
    }
    arv_stream_push_buffer(stream.get(), buffer);
    if (result) return std::move(*result);
  }
  return nothing_came();
}

Result<CameraFrame> AravisCamera::grab() {
  State& s = *state_;
  if (s.lost) return s.disconnected();
  auto picture = s.wait_for_picture();
  if (s.lost) return s.disconnected();
  GlibError error;
  arv_camera_stop_acquisition(s.camera.get(), error.out());
  if (error) return s.failed("ending the picture", error);
  return picture;
}

}  // namespace veneer::capture
