// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "base/image_files.h"

namespace veneer {

/// kBadFormat for a size that no picture of ours has, so that a damaged header is refused before
/// memory for it is asked for.
[[nodiscard]] inline Status check_image_size(const std::filesystem::path& path,
                                             std::int64_t width,
                                             std::int64_t height) {
  if (width > 0 && height > 0 && width <= kMaxImagePixels / height) return {};
  return fail(Errc::kBadFormat,
              "reading {}: its header claims {} x {} pixels, more than 2^28 or none: the file is "
              "damaged, or must be cut into smaller pictures",
              path.string(),
              width,
              height);
}

}  // namespace veneer
