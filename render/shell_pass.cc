// SPDX-License-Identifier: Apache-2.0
#include "render/shell_pass.h"

#include <utility>

#include "render/compensate_pass.h"
#include "render/draw_pass.h"

namespace veneer::render {
namespace {

constexpr char kShellFrag[] =
#include "render/shaders/shell.frag.inc"
    ;
constexpr char kUnderFrag[] =
#include "render/shaders/shell_under.frag.inc"
    ;

// Beyond the near plane, so that the first turn takes all.
constexpr float kNearest = 1.0F;

}  // namespace

std::string shell_vertex_source(int light_count) {
  return draw_vertex_source(light_count, Surfaces::kShells);
}

std::string shell_fragment_source(const btf::ModelShader& shader, int light_count) {
  VENEER_CHECK(shader.shells);
  return surface_header(light_count) +
         fmt::format("const int kShells = {};\n", shader.shells->heights.size()) + shader.source +
         "\n" + kShellFrag;
}

std::string shell_under_fragment_source() {
  return std::string("#version 450 core\n") + kUnderFrag;
}

ShellPass::ShellPass(std::vector<Light> lights,
                     const Eigen::Vector2d& texture_repeats,
                     const calibration::ProjectorGeometry& geometry)
    : lights_(std::move(lights)),
      texture_repeats_(texture_repeats),
      geometry_(geometry),
      uniforms_(make_buffer(nullptr, sizeof(FrameBlock), GL_DYNAMIC_STORAGE_BIT)),
      nearest_(make_texture_2d(GL_RGBA32F, geometry.width, geometry.height)),
      seen_(make_texture_2d(GL_RGBA32F, geometry.width, geometry.height)),
      seen_framebuffer_(make_framebuffer()),
      no_vertices_(make_vertex_array()),
      any_(make_query(GL_ANY_SAMPLES_PASSED)) {
  for (std::size_t i = 0; i < 2; ++i) {
    depths_[i] = make_texture_2d(GL_DEPTH_COMPONENT32F, geometry.width, geometry.height);
    nearest_framebuffers_[i] = make_framebuffer();
    const GLuint id = nearest_framebuffers_[i].id();
    glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT0, nearest_.id(), 0);
    glNamedFramebufferTexture(id, GL_DEPTH_ATTACHMENT, depths_[i].id(), 0);
  }
  glNamedFramebufferTexture(seen_framebuffer_.id(), GL_COLOR_ATTACHMENT0, seen_.id(), 0);
}

Result<ShellPass> ShellPass::create(const btf::ModelShader& shader,
                                    std::vector<Light> lights,
                                    const Eigen::Vector2d& texture_repeats,
                                    const calibration::ProjectorGeometry& geometry,
                                    double texel_m) {
  const auto light_count = static_cast<int>(lights.size());
  ShellPass pass(std::move(lights), texture_repeats, geometry);
  for (const GLuint framebuffer :
       {pass.nearest_framebuffers_[0].id(), pass.seen_framebuffer_.id()}) {
    if (glCheckNamedFramebufferStatus(framebuffer, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
      return fail(
          Errc::kUnavailable,
          "drawing shells: this GL cannot draw to {} x {} floats; ask for a smaller picture "
          "or fewer samples",
          geometry.width,
          geometry.height);
  }
  VENEER_ASSIGN(
      pass.program_,
      link_program(
          {{GL_VERTEX_SHADER, "draw.vert of shells", shell_vertex_source(light_count)},
           {GL_FRAGMENT_SHADER, "shell.frag", shell_fragment_source(shader, light_count)}}));
  VENEER_ASSIGN(
      pass.under_program_,
      link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                    {GL_FRAGMENT_SHADER, "shell_under.frag", shell_under_fragment_source()}}));
  VENEER_ASSIGN(pass.textures_, ModelTextures::upload(shader));
  const GLuint program = pass.program_.id();
  ModelTextures::assign_units(shader, program);
  pass.nearer_unit_ = static_cast<GLuint>(shader.textures.size());
  const auto unit = static_cast<GLint>(pass.nearer_unit_);
  glProgramUniform1i(program, glGetUniformLocation(program, "Nearer"), unit);
  glProgramUniform1i(program, glGetUniformLocation(program, "Seen"), unit + 1);
  pass.layer_ = glGetUniformLocation(program, "shell_layer");
  pass.height_ = glGetUniformLocation(program, "shell_height");
  for (const float height : shader.shells->heights)
    pass.heights_m_.push_back(static_cast<float>(height * texel_m));
  return pass;
}

// The nearest of what lies behind the last turn's; false where nothing does.
bool ShellPass::draw_next(const MeshBuffers& mesh, std::size_t turn) const {
  glBindFramebuffer(GL_FRAMEBUFFER, nearest_framebuffers_[turn % 2].id());
  glClearColor(0.0F, 0.0F, 0.0F, 0.0F);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glDisable(GL_BLEND);
  glEnable(GL_DEPTH_TEST);
  glUseProgram(program_.id());
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, uniforms_.id());
  textures_.bind();
  glBindTextureUnit(nearer_unit_, depths_[(turn + 1) % 2].id());
  glBindTextureUnit(nearer_unit_ + 1, seen_.id());
  glBeginQuery(GL_ANY_SAMPLES_PASSED, any_.id());
  for (std::size_t layer = 0; layer < heights_m_.size(); ++layer) {
    glUniform1i(layer_, static_cast<GLint>(layer));
    glUniform1f(height_, heights_m_[layer]);
    mesh.draw();
  }
  glEndQuery(GL_ANY_SAMPLES_PASSED);
  GLuint any = 0;
  glGetQueryObjectuiv(any_.id(), GL_QUERY_RESULT, &any);
  return any != 0;
}

// What one turn has drawn, as far as what was drawn before lets it be seen.
void ShellPass::add_beneath() const {
  glBindFramebuffer(GL_FRAMEBUFFER, seen_framebuffer_.id());
  glDisable(GL_DEPTH_TEST);
  glEnable(GL_BLEND);
  glBlendEquation(GL_FUNC_ADD);
  glBlendFunc(GL_ONE_MINUS_DST_ALPHA, GL_ONE);
  glUseProgram(under_program_.id());
  glBindTextureUnit(0, nearest_.id());
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glDisable(GL_BLEND);
}

void ShellPass::draw(const MeshBuffers& mesh, const DrawInput& input) const {
  const RigidTransform& world_from_eye = geometry_.world_from_projector;
  // Nobody projects: of the projector's place and distance nothing here is read.
  const FrameBlock block =
      frame_block(lights_,
                  texture_repeats_,
                  clip_from_projector(geometry_) * world_from_eye.inverse().matrix(),
                  world_from_eye.translation,
                  1.0,
                  input);
  glNamedBufferSubData(uniforms_.id(), 0, sizeof(block), &block);
  glViewport(0, 0, geometry_.width, geometry_.height);
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glDepthFunc(GL_GREATER);
  glClearDepth(0.0);
  constexpr float kNothing[] = {0.0F, 0.0F, 0.0F, 0.0F};
  glClearNamedFramebufferfv(seen_framebuffer_.id(), GL_COLOR, 0, kNothing);
  glClearNamedFramebufferfv(nearest_framebuffers_[1].id(), GL_DEPTH, 0, &kNearest);
  // Every turn that finds something is behind the last at some pixel, so that they end.
  for (std::size_t turn = 0; draw_next(mesh, turn); ++turn) add_beneath();
}

}  // namespace veneer::render
