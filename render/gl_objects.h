// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/: brings in the GL headers.

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <cassert>
#include <initializer_list>
#include <string_view>
#include <utility>

#include "base/result.h"

namespace veneer::render {

/// Owns the name of a GL object; move-only. It remembers the context that it was made in, which
/// must be current when it goes: only the thread that has the context deletes. The context is
/// therefore the first member of whoever owns both. Of a lost context, which cannot be made
/// current, nothing is left to delete.
template <void (*kDelete)(GLuint)>
class GlName {
 public:
  GlName() = default;
  explicit GlName(GLuint id) : id_(id), owner_(eglGetCurrentContext()) {}
  GlName(GlName&& other) noexcept : id_(std::exchange(other.id_, 0)), owner_(other.owner_) {}
  GlName& operator=(GlName&& other) noexcept {
    if (this != &other) {
      reset();
      id_ = std::exchange(other.id_, 0);
      owner_ = other.owner_;
    }
    return *this;
  }
  GlName(const GlName&) = delete;
  GlName& operator=(const GlName&) = delete;
  ~GlName() { reset(); }

  [[nodiscard]] GLuint id() const { return id_; }

 private:
  void reset() {
    if (id_ == 0) return;
    const EGLContext current = eglGetCurrentContext();
    assert(current == owner_ || current == EGL_NO_CONTEXT);
    if (current == owner_) kDelete(id_);
    id_ = 0;
  }
  GLuint id_ = 0;
  EGLContext owner_ = EGL_NO_CONTEXT;
};

inline void delete_texture(GLuint id) { glDeleteTextures(1, &id); }
inline void delete_buffer(GLuint id) { glDeleteBuffers(1, &id); }
inline void delete_framebuffer(GLuint id) { glDeleteFramebuffers(1, &id); }
inline void delete_renderbuffer(GLuint id) { glDeleteRenderbuffers(1, &id); }
inline void delete_vertex_array(GLuint id) { glDeleteVertexArrays(1, &id); }
inline void delete_query(GLuint id) { glDeleteQueries(1, &id); }
inline void delete_program(GLuint id) { glDeleteProgram(id); }
inline void delete_shader(GLuint id) { glDeleteShader(id); }

using GlTexture = GlName<&delete_texture>;
using GlBuffer = GlName<&delete_buffer>;
using GlFramebuffer = GlName<&delete_framebuffer>;
using GlRenderbuffer = GlName<&delete_renderbuffer>;
using GlVertexArray = GlName<&delete_vertex_array>;
using GlQuery = GlName<&delete_query>;
using GlProgram = GlName<&delete_program>;
using GlShader = GlName<&delete_shader>;

[[nodiscard]] GlTexture make_texture(GLenum target);
[[nodiscard]] GlBuffer make_buffer();
/// An immutable buffer with these contents; `flags` as of glNamedBufferStorage.
[[nodiscard]] GlBuffer make_buffer(const void* data, std::size_t bytes, GLbitfield flags);
[[nodiscard]] GlFramebuffer make_framebuffer();
[[nodiscard]] GlRenderbuffer make_renderbuffer();
[[nodiscard]] GlVertexArray make_vertex_array();
[[nodiscard]] GlQuery make_query(GLenum target);
/// A 2D texture without mipmaps, nearest, clamped to the edge.
[[nodiscard]] GlTexture make_texture_2d(GLenum internal_format, int width, int height);

/// One stage of a program: its source, in pieces that follow one another. `name` is for messages.
struct ShaderStage {
  GLenum stage;
  std::string_view name;
  std::string_view source;
};

/// Errors: kUnavailable with the driver's log.
[[nodiscard]] Result<GlProgram> link_program(std::initializer_list<ShaderStage> stages);

}  // namespace veneer::render
