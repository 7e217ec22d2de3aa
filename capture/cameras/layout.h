// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/camera.h"

namespace veneer::capture {

/// Reads the key `layout`: "polarsens-mono", "polarsens-colour"; kNone where it is absent.
/// Errors: kInvalidOption, naming both.
[[nodiscard]] Result<Mosaic> read_layout(TomlReader& config);
/// Side of the mosaic's cell in pixels: 1, 2 or 4.
[[nodiscard]] int cell_size(Mosaic mosaic);
/// Whether a picture of that size is whole cells. Errors: kInvalidOption.
[[nodiscard]] Status check_layout(Mosaic mosaic, int width, int height);

}  // namespace veneer::capture
