// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/result.h"
#include "base/safetensors.h"
#include "btf/material.h"

namespace veneer::btf {

/// A material whose values are those of `material` times `scale`: every radiance, the shader's too
/// (one multiplication a call), and what is reconstructed. Its contents have "scale" in their
/// metadata. A scale of 1 gives `material` itself.
/// @param scale  that of a set times what float16 may hold: 1e-33 to 1e33.
[[nodiscard]] std::unique_ptr<Material> with_scale(std::unique_ptr<Material> material,
                                                   double scale);
/// The scale of a stored material, 1 where the file has none. Errors: kBadFormat.
[[nodiscard]] Result<double> read_scale(const SafetensorsFile& file);

}  // namespace veneer::btf
