// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// `veneer calibrate geometry`: the lenses of a projector and a camera, and the pose between them,
/// from folders of pictures of a board on which a Gray code was shown.
[[nodiscard]] Result<int> calibrate_geometry(CommandLine& line);

}  // namespace veneer::cli
