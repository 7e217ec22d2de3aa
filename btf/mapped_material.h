// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "base/result.h"
#include "base/safetensors.h"
#include "btf/material.h"
#include "btf/texel_map.h"

namespace veneer::btf {

/// A material as large as `map`, each of whose places shows the texel of `material` that the map
/// names: a small sample on a large object (texel_synthesis.h). Its texels are the map's places,
/// its contents have a tensor "texel_map" ([height][width][2], column and row), and its shader
/// reads one texture more, once for each texel that it reads (TEXEL_MAP in models/texel_at.glsl).
/// Directions and numbers for a texel are those of `material`.
/// Errors: kInvalidOption (a material with a map, with mip levels, or of another size than the
/// sample of the map).
[[nodiscard]] Result<std::unique_ptr<Material>> with_texel_map(std::unique_ptr<Material> material,
                                                               TexelMap map);

/// The map of a stored material, if it has one. @param material  what else the file holds.
/// Errors: kBadFormat.
[[nodiscard]] Result<std::optional<TexelMap>> read_texel_map(const SafetensorsFile& file,
                                                             const Material& material);

/// Refuses, with `code`, a material with a map where it would be held against its set, which has no
/// such places.
[[nodiscard]] Status refuse_texel_map(const Material& material, Errc code, std::string_view doing);

}  // namespace veneer::btf
