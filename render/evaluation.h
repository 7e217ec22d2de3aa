// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/result.h"

namespace veneer::render {

/// Where a material is evaluated: as triangles are drawn, or in a compute pass over the pixels that
/// they cover, which first keep their place on the surface (surface_buffer.h). Which is faster
/// depends on the GPU and its driver; what is shown is the same but for rounding.
enum class Evaluation { kFragment, kCompute };

/// "fragment" or "compute". Errors: kInvalidOption.
[[nodiscard]] Result<Evaluation> parse_evaluation(std::string_view text);

}  // namespace veneer::render
