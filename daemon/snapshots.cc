// SPDX-License-Identifier: Apache-2.0
#include "daemon/snapshots.h"

#include <fmt/chrono.h>

#include <chrono>

#include "base/image_files.h"

namespace veneer::daemon {

Result<std::filesystem::path> write_snapshot(const std::filesystem::path& folder,
                                             ImageView<const Rgb16> codes,
                                             int bits) {
  if (folder.empty()) {
    return fail(Errc::kInvalidOption,
                "writing a snapshot: there is no place for it; set state_directory in the "
                "configuration");
  }
  const auto now = std::chrono::system_clock::now();
  const auto milliseconds =
      std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()) % 1000;
  const std::filesystem::path path =
      folder / fmt::format("snapshot-{:%Y-%m-%dT%H-%M-%S}.{:03}Z.png",
                           fmt::gmtime(std::chrono::system_clock::to_time_t(now)),
                           milliseconds.count());
  if (bits > 8) {
    VENEER_TRY(write_png(path, codes));
    return path;
  }
  Image<Rgb8> narrow(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y) {
    for (int x = 0; x < codes.width(); ++x) {
      for (std::size_t i = 0; i < 3; ++i)
        narrow(x, y)[i] = static_cast<std::uint8_t>(codes(x, y)[i]);
    }
  }
  VENEER_TRY(write_png(path, std::as_const(narrow).view()));
  return path;
}

}  // namespace veneer::daemon
