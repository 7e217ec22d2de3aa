// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison/shader_cost.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "simulation/materials/ring_directions.h"

namespace veneer::cli {
namespace {

TEST(CountInstructions, CountsWhatComputesAndWhatFetches) {
  const ShaderCost cost = count_instructions(R"(; SPIR-V
               OpCapability Shader
          %1 = OpExtInstImport "GLSL.std.450"
      %float = OpTypeFloat 32
         %10 = OpFMul %float %8 %9
         %11 = OpExtInst %float %1 Pow %10 %9
         %12 = OpImageFetch %v4float %5 %6
         %13 = OpImageSampleExplicitLod %v4float %5 %6 Lod %7
         %14 = OpImageQuerySizeLod %v2int %5 %6
         %15 = OpImage %16 %5
         %17 = OpCompositeExtract %float %12 0
               OpStore %18 %17)");
  EXPECT_EQ(cost.arithmetic, 2);
  EXPECT_EQ(cost.fetches, 2);
  EXPECT_FALSE(cost.loops_left);
  EXPECT_TRUE(count_instructions("OpLoopMerge %3 %4 None\n").loops_left);
  EXPECT_EQ(count_instructions("").arithmetic, 0);
}

#define SKIP_WITHOUT_SPIRV_TOOLS(cost)                           \
  if (!(cost) && (cost).error().code == Errc::kUnavailable) {    \
    GTEST_SKIP() << "compilers absent: " << (cost).error().what; \
  }

TEST(ShaderCost, WritesLoopsOut) {
  const auto cost = shader_cost(
      "vec3 twice(vec3 v) { return v * v; }\n"
      "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {\n"
      "  vec3 sum = light;\n"
      "  for (int i = 0; i < 5; ++i) sum = twice(sum + view);\n"
      "  return sum;\n"
      "}\n");
  SKIP_WITHOUT_SPIRV_TOOLS(cost);
  ASSERT_TRUE(cost) << cost.error().what;
  EXPECT_EQ(cost->arithmetic, 6);  // a sum, a product and between them four of both fused
  EXPECT_EQ(cost->fetches, 0);
  EXPECT_FALSE(cost->loops_left);
}

TEST(ShaderCost, WhatDoesNotCompileIsRefused) {
  const auto cost = shader_cost("vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) { return 1; }");
  SKIP_WITHOUT_SPIRV_TOOLS(cost);
  ASSERT_FALSE(cost);
  EXPECT_EQ(cost.error().code, Errc::kBadFormat);
  EXPECT_NE(cost.error().what.find("glslangValidator"), std::string::npos) << cost.error().what;
}

TEST(ShaderCost, EveryModelFetchesAsOftenAsItSays) {
  const TemporaryFolder folder;
  btf::SampleSetInfo info;
  info.width = info.height = 4;
  info.polarised = true;
  info.views = info.lights = simulation::ring_directions(25).value();
  auto writer = btf::SampleSetWriter::create(folder.path() / "a.btfset", info).value();
  for (int t = 0; t < 16; ++t) {
    int i = t;
    for (Eigen::half& value : writer.texel(t))
      value = Eigen::half(0.1F + 0.01F * static_cast<float>((i += 7) % 61));
  }
  ASSERT_TRUE(writer.finish());
  const btf::SampleSet set = btf::SampleSet::open(folder.path() / "a.btfset").value();
  SilentProgress progress;
  for (const btf::Model& model : btf::models()) {
    btf::FitOptions options;
    options.components = model.terms == 2 ? "3+1" : "5";
    options.clusters = 2;
    options.angular = 8;
    const auto material = model.fit(set, options, progress);
    ASSERT_TRUE(material) << model.name << ": " << material.error().what;
    const btf::ModelShader shader = (*material)->shader();
    const auto cost = shader_cost(shader.source);
    SKIP_WITHOUT_SPIRV_TOOLS(cost);
    ASSERT_TRUE(cost) << model.name << ": " << cost.error().what;
    EXPECT_EQ(cost->fetches, shader.fetches) << model.name;
    EXPECT_GT(cost->arithmetic, 0) << model.name;
    EXPECT_FALSE(cost->loops_left) << model.name;
  }
}

}  // namespace
}  // namespace veneer::cli
