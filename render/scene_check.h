// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include "base/result.h"
#include "render/scene.h"

namespace veneer::render {

/// Whether the lights and the mesh of a scene can be given to GL. Errors: kBadFormat.
[[nodiscard]] Status check_drawable(const Scene& scene);

}  // namespace veneer::render
