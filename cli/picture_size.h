// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/result.h"

namespace veneer::cli {

struct PictureSize {
  int width = 0;
  int height = 0;
};

/// What --size says, "640x480". Errors: kInvalidOption (it says something else, or a side is not
/// from `least` to `most`).
[[nodiscard]] Result<PictureSize> parse_size(std::string_view text,
                                             int least = 1,
                                             int most = 16384);

}  // namespace veneer::cli
