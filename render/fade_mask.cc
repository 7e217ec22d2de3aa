// SPDX-License-Identifier: Apache-2.0
#include "render/fade_mask.h"

#include "render/compensate_pass.h"

namespace veneer::render {
namespace {

constexpr char kFadeGlsl[] =
#include "render/shaders/fade.glsl.inc"
    ;
constexpr char kFadeMaskFrag[] =
#include "render/shaders/fade_mask.frag.inc"
    ;

}  // namespace

std::string fade_source() {
  return fmt::format("const uint kFadeTile = {}u;\n", kFadeTile) + kFadeGlsl;
}

std::string fade_mask_fragment_source() {
  return "#version 450 core\n" + fade_source() + kFadeMaskFrag;
}

Result<FadeMask> FadeMask::create() {
  FadeMask mask;
  VENEER_ASSIGN(
      mask.program_,
      link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                    {GL_FRAGMENT_SHADER, "fade_mask.frag", fade_mask_fragment_source()}}));
  const GLuint program = mask.program_.id();
  mask.fade_ = glGetUniformLocation(program, "fade");
  mask.is_next_ = glGetUniformLocation(program, "part_is_next");
  mask.pixels_ = glGetUniformLocation(program, "pixels");
  mask.reach_ = glGetUniformLocation(program, "reach");
  mask.corners_ = glGetUniformLocation(program, "corners");
  mask.no_vertices_ = make_vertex_array();
  return mask;
}

void FadeMask::write(const FadePart& part, const Raster& raster) const {
  const GLuint program = program_.id();
  glProgramUniform1f(program, fade_, part.fade);
  glProgramUniform1i(program, is_next_, part.is_next ? 1 : 0);
  glProgramUniform2f(program, pixels_, raster.pixels.x(), raster.pixels.y());
  glProgramUniform2f(program, reach_, raster.reach.x(), raster.reach.y());
  glProgramUniform1i(program, corners_, raster.reach.isZero(0.0F) ? 1 : 4);
  glUseProgram(program);
  glViewport(0, 0, raster.size.x(), raster.size.y());
  glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
  glDepthFunc(GL_ALWAYS);
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glDepthFunc(GL_GREATER);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

}  // namespace veneer::render
