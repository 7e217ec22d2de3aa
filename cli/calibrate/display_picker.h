// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"
#include "base/result.h"

namespace veneer::cli {

/// A picture that shows a number as large as fits, white on grey, with a white rim one pixel wide:
/// where the rim is not seen whole, the display cuts the picture.
/// @param number  >= 0 (checked).   @param width, height  pixels, at least 16 (checked).
[[nodiscard]] Image<Rgb16> number_picture(int number, int width, int height);

/// Shows every display of the desktop its own number and asks which is the projector.
/// Errors: kUnavailable (no desktop), kCancelled (none was named).
[[nodiscard]] Result<int> pick_display();

}  // namespace veneer::cli
