// SPDX-License-Identifier: Apache-2.0
#include "render/gl_objects.h"

#include <algorithm>
#include <string>
#include <vector>

namespace veneer::render {
namespace {

template <class GetLength, class GetText>
std::string info_log(GLuint id, GetLength get_length, GetText get_text) {
  GLint length = 0;
  get_length(id, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<std::size_t>(std::max(length, 1)), '\0');
  GLsizei written = 0;
  get_text(id, static_cast<GLsizei>(log.size()), &written, log.data());
  log.resize(static_cast<std::size_t>(written));
  return log;
}

Result<GlShader> compile(const ShaderStage& stage) {
  GlShader shader(glCreateShader(stage.stage));
  const char* text = stage.source.data();
  const auto length = static_cast<GLint>(stage.source.size());
  glShaderSource(shader.id(), 1, &text, &length);
  glCompileShader(shader.id());
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader.id(), GL_COMPILE_STATUS, &compiled);
  if (compiled != GL_TRUE)
    return fail(Errc::kUnavailable,
                "compiling the shader {}: the driver refuses it: {}",
                stage.name,
                info_log(shader.id(), glGetShaderiv, glGetShaderInfoLog));
  return shader;
}

}  // namespace

GlTexture make_texture(GLenum target) {
  GLuint id = 0;
  glCreateTextures(target, 1, &id);
  return GlTexture(id);
}

GlBuffer make_buffer() {
  GLuint id = 0;
  glCreateBuffers(1, &id);
  return GlBuffer(id);
}

GlBuffer make_buffer(const void* data, std::size_t bytes, GLbitfield flags) {
  GlBuffer buffer = make_buffer();
  glNamedBufferStorage(buffer.id(), static_cast<GLsizeiptr>(bytes), data, flags);
  return buffer;
}

GlFramebuffer make_framebuffer() {
  GLuint id = 0;
  glCreateFramebuffers(1, &id);
  return GlFramebuffer(id);
}

GlRenderbuffer make_renderbuffer() {
  GLuint id = 0;
  glCreateRenderbuffers(1, &id);
  return GlRenderbuffer(id);
}

GlVertexArray make_vertex_array() {
  GLuint id = 0;
  glCreateVertexArrays(1, &id);
  return GlVertexArray(id);
}

GlQuery make_query(GLenum target) {
  GLuint id = 0;
  glCreateQueries(target, 1, &id);
  return GlQuery(id);
}

GlTexture make_texture_2d(GLenum internal_format, int width, int height) {
  GlTexture texture = make_texture(GL_TEXTURE_2D);
  glTextureStorage2D(texture.id(), 1, internal_format, width, height);
  glTextureParameteri(texture.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTextureParameteri(texture.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTextureParameteri(texture.id(), GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTextureParameteri(texture.id(), GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  return texture;
}

Result<GlProgram> link_program(std::initializer_list<ShaderStage> stages) {
  std::vector<GlShader> shaders;
  std::string names;
  for (const ShaderStage& stage : stages) {
    VENEER_ASSIGN(GlShader shader, compile(stage));
    shaders.push_back(std::move(shader));
    names += (names.empty() ? "" : " and ") + std::string(stage.name);
  }
  GlProgram program(glCreateProgram());
  for (const GlShader& shader : shaders) glAttachShader(program.id(), shader.id());
  glLinkProgram(program.id());
  GLint linked = GL_FALSE;
  glGetProgramiv(program.id(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE)
    return fail(Errc::kUnavailable,
                "linking {}: the driver refuses it: {}",
                names,
                info_log(program.id(), glGetProgramiv, glGetProgramInfoLog));
  for (const GlShader& shader : shaders) glDetachShader(program.id(), shader.id());
  return program;
}

}  // namespace veneer::render
