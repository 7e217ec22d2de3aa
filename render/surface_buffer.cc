// SPDX-License-Identifier: Apache-2.0
#include "render/surface_buffer.h"

#include <array>

#include "render/draw_pass.h"
#include "render/evaluation.h"

namespace veneer::render {
namespace {

constexpr int kGroupSide = 8;  // local size of draw.comp
constexpr std::size_t kBytesPerPixel = 2 * 16 + 4;

constexpr char kWordsGlsl[] =
#include "render/shaders/surface_words.glsl.inc"
    ;
constexpr char kStoreFrag[] =
#include "render/shaders/store_surface.frag.inc"
    ;
constexpr char kDrawFrag[] =
#include "render/shaders/draw.frag.inc"
    ;
constexpr char kDrawComp[] =
#include "render/shaders/draw.comp.inc"
    ;

// The texture that is drawn to, and how it stores a pixel.
struct Target {
  GLuint texture;
  GLenum format;
};

Target colour_target(GLuint framebuffer) {
  GLint texture = 0;
  glGetNamedFramebufferAttachmentParameteriv(
      framebuffer, GL_COLOR_ATTACHMENT0, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_NAME, &texture);
  GLint format = 0;
  glGetTextureLevelParameteriv(
      static_cast<GLuint>(texture), 0, GL_TEXTURE_INTERNAL_FORMAT, &format);
  return {static_cast<GLuint>(texture), static_cast<GLenum>(format)};
}

}  // namespace

std::string store_surface_fragment_source(int light_count) {
  return surface_header(light_count) + kWordsGlsl + kStoreFrag;
}

std::string draw_compute_source(const std::string& model_source,
                                int light_count,
                                const TexelFilter& filter) {
  return surface_header(light_count) + "#define IN_COMPUTE\n" + kWordsGlsl + model_source + "\n" +
         radiance_source("btf_radiance(uv, view, light)", filter) + kDrawFrag + kDrawComp;
}

SurfaceBuffer::SurfaceBuffer(int width, int height)
    : width_(width),
      height_(height),
      places_(make_texture_2d(GL_RGBA32UI, width, height)),
      frames_(make_texture_2d(GL_RGBA32UI, width, height)),
      depth_(make_texture_2d(GL_DEPTH_COMPONENT32F, width, height)),
      framebuffer_(make_framebuffer()) {
  const GLuint id = framebuffer_.id();
  glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT0, places_.id(), 0);
  glNamedFramebufferTexture(id, GL_COLOR_ATTACHMENT1, frames_.id(), 0);
  glNamedFramebufferTexture(id, GL_DEPTH_ATTACHMENT, depth_.id(), 0);
  constexpr std::array<GLenum, 2> kBuffers{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glNamedFramebufferDrawBuffers(id, kBuffers.size(), kBuffers.data());
}

Result<SurfaceBuffer> SurfaceBuffer::create(int light_count, int width, int height) {
  SurfaceBuffer buffer(width, height);
  if (glCheckNamedFramebufferStatus(buffer.framebuffer_.id(), GL_FRAMEBUFFER) !=
      GL_FRAMEBUFFER_COMPLETE)
    return fail(Errc::kUnavailable,
                "making room for surface points: this GL cannot draw to two integer textures; "
                "evaluate materials in the fragment stage");
  VENEER_ASSIGN(buffer.program_,
                link_program({{GL_VERTEX_SHADER, "draw.vert", draw_vertex_source(light_count)},
                              {GL_FRAGMENT_SHADER,
                               "store_surface.frag",
                               store_surface_fragment_source(light_count)}}));
  return buffer;
}

void SurfaceBuffer::begin() const {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glClear(GL_DEPTH_BUFFER_BIT);  // which says what is covered
}

void SurfaceBuffer::assign(GLuint program, GLuint first_unit) {
  first_unit_ = first_unit;
  auto unit = static_cast<GLint>(first_unit);
  for (const char* sampler : {"SurfacePlaces", "SurfaceFrames", "SurfaceDepth"})
    glProgramUniform1i(program, glGetUniformLocation(program, sampler), unit++);
  nearest_ = glGetUniformLocation(program, "nearest");
}

void SurfaceBuffer::evaluate(GLuint framebuffer, bool masked) const {
  // No depth is more than 1, and of a fragment it is 1 in the near plane alone.
  glUniform1f(nearest_, masked ? 1.0F : 2.0F);
  GLuint unit = first_unit_;
  for (const GlTexture* texture : {&places_, &frames_, &depth_})
    glBindTextureUnit(unit++, texture->id());
  const Target target = colour_target(framebuffer);
  glBindImageTexture(0, target.texture, 0, GL_FALSE, 0, GL_WRITE_ONLY, target.format);
  const auto groups = [](int pixels) {
    return static_cast<GLuint>((pixels + kGroupSide - 1) / kGroupSide);
  };
  glDispatchCompute(groups(width_), groups(height_), 1);
  glMemoryBarrier(GL_FRAMEBUFFER_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
}

std::size_t SurfaceBuffer::gpu_bytes() const {
  return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) * kBytesPerPixel;
}

}  // namespace veneer::render
