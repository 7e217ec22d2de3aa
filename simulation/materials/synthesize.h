// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"
#include "simulation/materials/body_materials.h"
#include "simulation/materials/height_field.h"
#include "simulation/materials/synthesis_options.h"

namespace veneer::simulation {

/// One line of the registry of synthetic materials that are height fields.
struct HeightFieldMaterial {
  std::string_view name;
  std::string_view summary;
  /// A tile that repeats without a seam; its features scale with the tile, so that a larger size
  /// shows the same tile more finely.
  /// @param size  texels along each side of the set, > 0; the relief is kCellsPerTexel times finer.
  HeightField (*make)(int size, std::uint64_t seed);
};

/// Every material, sorted by name.
[[nodiscard]] std::span<const HeightFieldMaterial> height_field_materials();
/// Errors: kInvalidOption, naming the materials there are.
[[nodiscard]] Result<const HeightFieldMaterial*> find_height_field_material(std::string_view name);

/// Path-traces a material and writes a polarised sample set (btf/sample_set.h): for every texel,
/// view and light the specular and the diffuse part. What counts as which is said in tracer.h. The
/// same options give the same samples on any number of threads. Nothing is left behind by a
/// failure. Errors: kInvalidOption, kIo.
[[nodiscard]] Status synthesize(const HeightFieldMaterial& material,
                                const std::filesystem::path& out,
                                const SynthesisOptions& options,
                                Progress& progress);
/// Likewise. Every shadow is a ray here, so that a path costs about as many as there are lights.
[[nodiscard]] Status synthesize(const BodyMaterial& material,
                                const std::filesystem::path& out,
                                const SynthesisOptions& options,
                                Progress& progress);

}  // namespace veneer::simulation
