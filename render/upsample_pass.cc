// SPDX-License-Identifier: Apache-2.0
#include "render/upsample_pass.h"

#include "render/compensate_pass.h"

namespace veneer::render {
namespace {

constexpr char kUpsampleFrag[] =
#include "render/shaders/upsample.frag.inc"
    ;

}  // namespace

std::string upsample_fragment_source(bool has_part) {
  return "#version 450 core\n" + (has_part ? "#define PART\n" + fade_source() : std::string()) +
         kUpsampleFrag;
}

Result<UpsamplePass::Program> UpsamplePass::link(bool has_part) {
  Program result;
  VENEER_ASSIGN(
      result.program,
      link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                    {GL_FRAGMENT_SHADER, "upsample.frag", upsample_fragment_source(has_part)}}));
  const GLuint program = result.program.id();
  result.pixels = glGetUniformLocation(program, "pixels");
  result.fade = glGetUniformLocation(program, "fade");
  result.is_next = glGetUniformLocation(program, "part_is_next");
  return result;
}

Result<UpsamplePass> UpsamplePass::create() {
  UpsamplePass pass;
  VENEER_ASSIGN(pass.whole_, link(false));
  VENEER_ASSIGN(pass.part_, link(true));
  pass.no_vertices_ = make_vertex_array();
  return pass;
}

void UpsamplePass::run(const DrawTarget& from, const DrawTarget& to) const {
  run(whole_, from, to);
}

void UpsamplePass::run(const DrawTarget& from, const DrawTarget& to, const FadePart& part) const {
  const GLuint program = part_.program.id();
  glProgramUniform1f(program, part_.fade, part.fade);
  glProgramUniform1i(program, part_.is_next, part.is_next ? 1 : 0);
  run(part_, from, to);
}

void UpsamplePass::run(const Program& program, const DrawTarget& from, const DrawTarget& to) const {
  const Eigen::Vector2f pixels = from.size().cast<float>().cwiseQuotient(to.size().cast<float>());
  glProgramUniform2f(program.program.id(), program.pixels, pixels.x(), pixels.y());
  glBindFramebuffer(GL_FRAMEBUFFER, to.framebuffer());
  glViewport(0, 0, to.size().x(), to.size().y());
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glUseProgram(program.program.id());
  glBindTextureUnit(0, from.colour());
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace veneer::render
