// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/aravis/internal_options.h"
#include "capture/cameras/layout.h"

namespace veneer::capture {

Result<AravisOptions> AravisOptions::read(TomlReader& config) {
  AravisOptions options;
  config.read("timeout_s", options.timeout_s);
  config.read("full_scale", options.full_scale);
  config.read("packet_size", options.packet_size);
  config.read("packet_delay_us", options.packet_delay_us);
  if (config.contains("gain_raw")) config.read("gain_raw", options.gain_raw.emplace());
  VENEER_ASSIGN(options.layout, read_layout(config));
  if (!(options.timeout_s > 0 && options.timeout_s <= 3600)) {
    return fail(Errc::kInvalidOption,
                "opening the camera: timeout_s is {}; it must be above 0 and at most 3600",
                options.timeout_s);
  }
  if (options.full_scale < 0 || options.full_scale > 65535) {
    return fail(
        Errc::kInvalidOption,
        "opening the camera: full_scale is {}; it must be the count of a saturated pixel, 1 "
        "to 65535",
        options.full_scale);
  }
  if (options.packet_size != 0 && (options.packet_size < 576 || options.packet_size > 16260)) {
    return fail(
        Errc::kInvalidOption,
        "opening the camera: packet_size is {}; it must be 576 to 16260 bytes, no more than "
        "the MTU of the network (1500, with jumbo frames 9000)",
        options.packet_size);
  }
  return options;
}

}  // namespace veneer::capture
