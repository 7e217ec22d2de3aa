// SPDX-License-Identifier: Apache-2.0
#include "tests/stability/gl_probe.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/testing/fp_trap.h"
#include "render/compensate_pass.h"
#include "render/egl_context.h"
#include "render/gl_objects.h"
#include "render/model_textures.h"

namespace veneer::stability {
namespace {

using Eigen::Vector4f;

constexpr int kColumns = 64;

// One for the whole program, gone before the driver's own destructors run.
std::optional<Result<render::EglContext>>& context() {
  static std::optional<Result<render::EglContext>> the_context;
  return the_context;
}
class EndContext final : public ::testing::Environment {
 public:
  void TearDown() override { context().reset(); }
};
[[maybe_unused]] const ::testing::Environment* const kEndContext =
    ::testing::AddGlobalTestEnvironment(new EndContext);  // gtest owns it

std::string source_of(const btf::ModelShader& shader) {
  return "#version 450 core\n" + shader.source +
         fmt::format(R"(
layout(std430, binding = 2) readonly buffer Queries {{ vec4 queries[]; }};
layout(location = 0) out vec4 result;
void main() {{
  int i = 3 * (int(gl_FragCoord.y) * {} + int(gl_FragCoord.x));
  result = vec4(btf_radiance(queries[i].xy, queries[i + 1].xyz, queries[i + 2].xyz), 1.0);
}}
)",
                     kColumns);
}

}  // namespace

struct GlProbe::State {
  int width = 0;
  int height = 0;
  render::GlProgram program;
  render::ModelTextures textures;
};

GlProbe::GlProbe(std::unique_ptr<State> state) : state_(std::move(state)) {}
GlProbe::GlProbe(GlProbe&&) noexcept = default;
GlProbe::~GlProbe() {
  const FpPause pause;
  state_.reset();
}

Result<GlProbe> GlProbe::create(const btf::Material& material) {
  const btf::ModelShader shader = material.shader();
  const FpPause pause;
  if (!context()) context().emplace(render::EglContext::create());
  if (!*context()) return tl::unexpected<Error>(context()->error());
  VENEER_ASSIGN(render::GlProgram program,
                render::link_program(
                    {{GL_VERTEX_SHADER, "fullscreen.vert", render::fullscreen_vertex_source()},
                     {GL_FRAGMENT_SHADER, "the model", source_of(shader)}}));
  VENEER_ASSIGN(render::ModelTextures textures, render::ModelTextures::upload(shader));
  render::ModelTextures::assign_units(shader, program.id());
  return GlProbe(std::make_unique<State>(
      State{material.width(), material.height(), std::move(program), std::move(textures)}));
}

std::vector<Eigen::Vector3d> GlProbe::draw(std::span<const Query> queries) const {
  const FpPause pause;
  const int rows = (static_cast<int>(queries.size()) + kColumns - 1) / kColumns;
  std::vector<Vector4f> input(static_cast<std::size_t>(3 * rows * kColumns), Vector4f(0, 0, 1, 0));
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Query& query = queries[i];
    const auto centre = [](int at, int side) {
      return (static_cast<float>(at) + 0.5F) / static_cast<float>(side);
    };
    input[3 * i] = {centre(query.texel % state_->width, state_->width),
                    centre(query.texel / state_->width, state_->height),
                    0.0F,
                    0.0F};
    input[3 * i + 1].head<3>() = query.view.cast<float>();
    input[3 * i + 2].head<3>() = query.light.cast<float>();
  }
  const render::GlBuffer buffer =
      render::make_buffer(input.data(), input.size() * sizeof(Vector4f), 0);
  const render::GlTexture target = render::make_texture_2d(GL_RGBA32F, kColumns, rows);
  const render::GlFramebuffer framebuffer = render::make_framebuffer();
  const render::GlVertexArray no_vertices = render::make_vertex_array();
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, target.id(), 0);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glViewport(0, 0, kColumns, rows);
  glDisable(GL_DEPTH_TEST);
  glUseProgram(state_->program.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, buffer.id());
  state_->textures.bind();
  glBindVertexArray(no_vertices.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  std::vector<Vector4f> output(static_cast<std::size_t>(rows * kColumns));
  glReadPixels(0, 0, kColumns, rows, GL_RGBA, GL_FLOAT, output.data());
  std::vector<Eigen::Vector3d> values;
  for (std::size_t i = 0; i < queries.size(); ++i)
    values.emplace_back(output[i].head<3>().cast<double>());
  return values;
}

std::vector<Query> rounded_to_float(std::vector<Query> queries) {
  for (Query& query : queries) {
    query.view = query.view.cast<float>().cast<double>();
    query.light = query.light.cast<float>().cast<double>();
  }
  return queries;
}

}  // namespace veneer::stability
