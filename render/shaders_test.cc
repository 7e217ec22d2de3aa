// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "render/compensate_pass.h"
#include "render/draw_pass.h"
#include "render/fade_mask.h"
#include "render/internal_glslang.h"
#include "render/scanout_pass.h"
#include "render/shell_pass.h"
#include "render/upsample_pass.h"

namespace veneer::render {
namespace {

btf::ModelShader model_of_shells() {
  btf::ModelShader shader;
  shader.source =
      "vec4 btf_shell(int layer, vec2 uv, vec3 view, vec3 light) { return vec4(uv, light.z, "
      "layer); }";
  shader.shells = btf::ShellLayers{{1.0F, 0.0F}};
  return shader;
}

constexpr char kAnyModel[] =
    "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) { return vec3(uv, view.z + light.z); }";

TEST(Shaders, AreValidByTheReferenceCompiler) {
  if (!has_glslang()) GTEST_SKIP() << "glslangValidator absent: install glslang-tools";
  for (const CompensateKind kind :
       {CompensateKind::kNone, CompensateKind::kPlain, CompensateKind::kResidual})
    for (const bool has_ceiling : {false, true})
      EXPECT_EQ(glslang_complaints(compensate_fragment_source(kind, has_ceiling), "frag"), "");
  EXPECT_EQ(glslang_complaints(fullscreen_vertex_source(), "vert"), "");
  EXPECT_EQ(glslang_complaints(count_compute_source(), "comp"), "");
  EXPECT_EQ(glslang_complaints(fade_mask_fragment_source(), "frag"), "");
  for (const bool has_part : {false, true})
    EXPECT_EQ(glslang_complaints(upsample_fragment_source(has_part), "frag"), "");
  EXPECT_EQ(glslang_complaints(scanout_fragment_source(), "frag"), "");
  EXPECT_EQ(glslang_complaints(shell_under_fragment_source(), "frag"), "");
  for (const int lights : {1, kMaxLights}) {
    EXPECT_EQ(glslang_complaints(shell_vertex_source(lights), "vert"), "");
    EXPECT_EQ(glslang_complaints(shell_fragment_source(model_of_shells(), lights), "frag"), "");
    EXPECT_EQ(glslang_complaints(draw_vertex_source(lights), "vert"), "");
    EXPECT_EQ(glslang_complaints(probe_fragment_source(lights), "frag"), "");
    for (const bool point_lights : {false, true})
      EXPECT_EQ(glslang_complaints(plain_fragment_source(lights, point_lights), "frag"), "");
    EXPECT_EQ(glslang_complaints(draw_fragment_source(kAnyModel, lights), "frag"), "");
    EXPECT_EQ(glslang_complaints(draw_compute_source(kAnyModel, lights), "comp"), "");
    EXPECT_EQ(glslang_complaints(store_surface_fragment_source(lights), "frag"), "");
    const std::string with_levels = std::string("int texel_level = 0;\n") + kAnyModel;
    for (const bool average : {false, true})
      for (const int levels : {1, 2})
        EXPECT_EQ(glslang_complaints(
                      draw_fragment_source(with_levels, lights, {{4, 3}, levels, average}), "frag"),
                  "");
  }
}

TEST(Shaders, AreRefusedByTheReferenceCompilerWhereTheyAreWrong) {
  if (!has_glslang()) GTEST_SKIP() << "glslangValidator absent: install glslang-tools";
  EXPECT_NE(glslang_complaints(draw_fragment_source("", 1), "frag"), "");
}

}  // namespace
}  // namespace veneer::render
