// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/image.h"
#include "base/result.h"

namespace veneer::daemon {

/// Writes a frame's codes as they are: a PNG of 8 bits where they have so many, else of 16, in
/// which the codes lie in the low bits. Named after the time of day. Errors: kInvalidOption (no
/// folder), kIo.
[[nodiscard]] Result<std::filesystem::path> write_snapshot(const std::filesystem::path& folder,
                                                           ImageView<const Rgb16> codes,
                                                           int bits);

}  // namespace veneer::daemon
