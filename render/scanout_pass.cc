// SPDX-License-Identifier: Apache-2.0
#include "render/scanout_pass.h"

#include "render/compensate_pass.h"

namespace veneer::render {
namespace {

constexpr char kScanoutFrag[] =
#include "render/shaders/scanout.frag.inc"
    ;

constexpr GLuint maximum_of(int bits) { return (1U << static_cast<unsigned>(bits)) - 1U; }

}  // namespace

std::string scanout_fragment_source() { return std::string("#version 450 core\n") + kScanoutFrag; }

Result<ScanoutPass> ScanoutPass::create(int code_bits) {
  VENEER_CHECK(code_bits > 0 && code_bits <= 16);
  ScanoutPass pass;
  VENEER_ASSIGN(pass.program_,
                link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                              {GL_FRAGMENT_SHADER, "scanout.frag", scanout_fragment_source()}}));
  const GLuint program = pass.program_.id();
  glProgramUniform1ui(
      program, glGetUniformLocation(program, "code_maximum"), maximum_of(code_bits));
  pass.buffer_maximum_location_ = glGetUniformLocation(program, "buffer_maximum");
  pass.no_vertices_ = make_vertex_array();
  return pass;
}

void ScanoutPass::run(
    GLuint codes, GLuint framebuffer, int buffer_bits, int width, int height) const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glViewport(0, 0, width, height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDisable(GL_DITHER);  // on unless told; a driver may alter what is stored with it
  glUseProgram(program_.id());
  glProgramUniform1ui(program_.id(), buffer_maximum_location_, maximum_of(buffer_bits));
  glBindTextureUnit(0, codes);
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace veneer::render
