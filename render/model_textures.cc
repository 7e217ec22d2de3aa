// SPDX-License-Identifier: Apache-2.0
#include "render/model_textures.h"

#include <string_view>

namespace veneer::render {
namespace {

using btf::ModelTexture;
using btf::TexelFormat;
using btf::TextureKind;

struct GlFormat {
  GLenum internal;
  GLenum layout;
  GLenum type;
  bool integer;
};

GlFormat gl_format(TexelFormat format) {
  switch (format) {
    case TexelFormat::kR8ui:
      return {GL_R8UI, GL_RED_INTEGER, GL_UNSIGNED_BYTE, true};
    case TexelFormat::kR16ui:
      return {GL_R16UI, GL_RED_INTEGER, GL_UNSIGNED_SHORT, true};
    case TexelFormat::kRg16ui:
      return {GL_RG16UI, GL_RG_INTEGER, GL_UNSIGNED_SHORT, true};
    case TexelFormat::kRgba16ui:
      return {GL_RGBA16UI, GL_RGBA_INTEGER, GL_UNSIGNED_SHORT, true};
    case TexelFormat::kRgba32ui:
      return {GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, true};
    case TexelFormat::kRgba8:
      return {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, false};
    case TexelFormat::kRgba8Snorm:
      return {GL_RGBA8_SNORM, GL_RGBA, GL_BYTE, false};
    case TexelFormat::kR16f:
      return {GL_R16F, GL_RED, GL_HALF_FLOAT, false};
    case TexelFormat::kRg16f:
      return {GL_RG16F, GL_RG, GL_HALF_FLOAT, false};
    case TexelFormat::kRgba16f:
      return {GL_RGBA16F, GL_RGBA, GL_HALF_FLOAT, false};
    case TexelFormat::kRgba32f:
      return {GL_RGBA32F, GL_RGBA, GL_FLOAT, false};
  }
  VENEER_CHECK(false);
}

GLint limit(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

Status check_size(const ModelTexture& t) {
  const bool volume = t.kind == TextureKind::k3D;
  const GLint side = limit(volume ? GL_MAX_3D_TEXTURE_SIZE : GL_MAX_TEXTURE_SIZE);
  GLint depth = 1;
  if (volume) depth = side;
  if (t.kind == TextureKind::k2DArray) depth = limit(GL_MAX_ARRAY_TEXTURE_LAYERS);
  if (t.width <= side && t.height <= side && t.depth <= depth) return {};
  return fail(
      Errc::kUnavailable,
      "uploading the material's {}: it is {} x {} x {}, and this GL takes at most {} x {} x {}; "
      "fit it with fewer clusters, components or angular nodes",
      t.sampler,
      t.width,
      t.height,
      t.depth,
      side,
      side,
      depth);
}

Result<GlTexture> upload_one(const ModelTexture& t) {
  VENEER_TRY(check_size(t));
  const GlFormat format = gl_format(t.format);
  const auto texels = static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height) *
                      static_cast<std::size_t>(t.depth);
  VENEER_CHECK(t.data.size() == texels * btf::bytes_per_texel(t.format));
  VENEER_CHECK(!(t.linear && format.integer));
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  const GLenum target = t.kind == TextureKind::k2D        ? GL_TEXTURE_2D
                        : t.kind == TextureKind::k2DArray ? GL_TEXTURE_2D_ARRAY
                                                          : GL_TEXTURE_3D;
  GlTexture texture = make_texture(target);
  if (t.kind == TextureKind::k2D) {
    VENEER_CHECK(t.depth == 1);
    glTextureStorage2D(texture.id(), 1, format.internal, t.width, t.height);
    glTextureSubImage2D(
        texture.id(), 0, 0, 0, t.width, t.height, format.layout, format.type, t.data.data());
  } else {
    glTextureStorage3D(texture.id(), 1, format.internal, t.width, t.height, t.depth);
    glTextureSubImage3D(texture.id(),
                        0,
                        0,
                        0,
                        0,
                        t.width,
                        t.height,
                        t.depth,
                        format.layout,
                        format.type,
                        t.data.data());
  }
  const GLint filter = t.linear ? GL_LINEAR : GL_NEAREST;
  glTextureParameteri(texture.id(), GL_TEXTURE_MIN_FILTER, filter);
  glTextureParameteri(texture.id(), GL_TEXTURE_MAG_FILTER, filter);
  for (const GLenum side : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
    glTextureParameteri(texture.id(), side, GL_CLAMP_TO_EDGE);
  return texture;
}

}  // namespace

Result<ModelTextures> ModelTextures::upload(const btf::ModelShader& shader) {
  const auto units = static_cast<std::size_t>(limit(GL_MAX_TEXTURE_IMAGE_UNITS));
  if (shader.textures.size() > units)
    return fail(Errc::kUnavailable,
                "uploading the material: its shader reads {} textures and this GL allows {}",
                shader.textures.size(),
                units);
  ModelTextures result;
  for (const ModelTexture& t : shader.textures) {
    VENEER_ASSIGN(GlTexture texture, upload_one(t));
    result.textures_.push_back(std::move(texture));
  }
  if (glGetError() == GL_OUT_OF_MEMORY)
    return fail(
        Errc::kUnavailable,
        "uploading the material: {} MiB do not fit into the GPU's memory; fit it with fewer "
        "clusters or components",
        shader.gpu_bytes() >> 20U);
  return result;
}

void ModelTextures::assign_units(const btf::ModelShader& shader, GLuint program) {
  GLint unit = 0;
  // -1, which GL ignores, where the compiler found that the sampler is never read.
  for (const ModelTexture& t : shader.textures)
    glProgramUniform1i(program, glGetUniformLocation(program, t.sampler.c_str()), unit++);
}

void ModelTextures::bind() const {
  GLuint unit = 0;
  for (const GlTexture& texture : textures_) glBindTextureUnit(unit++, texture.id());
}

}  // namespace veneer::render
