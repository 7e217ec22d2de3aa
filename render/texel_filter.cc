// SPDX-License-Identifier: Apache-2.0
#include "render/texel_filter.h"

namespace veneer::render {
namespace {

constexpr char kTexelsGlsl[] =
#include "render/shaders/texels.glsl.inc"
    ;

}  // namespace

TexelFilter texel_filter(const btf::Material& material, bool average) {
  return {{material.width(), material.height()}, material.mip_levels(), average};
}

std::string radiance_source(std::string_view sample, const TexelFilter& filter) {
  if (!filter.average && filter.mip_levels == 1)
    return fmt::format("#define RADIANCE(uv, view, light) {}\n", sample);
  std::string source = fmt::format(
      "#define SAMPLE(uv, view, light) {}\nconst ivec2 kSampleTexels = ivec2({}, {});\n",
      sample,
      filter.texels.x(),
      filter.texels.y());
  if (filter.mip_levels > 1) source += fmt::format("#define MIP_LEVELS {}\n", filter.mip_levels);
  if (filter.average) source += "#define AVERAGE_TEXELS\n";
  return source + kTexelsGlsl + "#define RADIANCE(uv, view, light) over_texels(uv, view, light)\n";
}

}  // namespace veneer::render
