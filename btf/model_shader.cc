// SPDX-License-Identifier: Apache-2.0
#include "btf/model_shader.h"

#include "base/result.h"

namespace veneer::btf {

std::size_t bytes_per_texel(TexelFormat format) {
  switch (format) {
    case TexelFormat::kR8ui:
      return 1;
    case TexelFormat::kR16ui:
    case TexelFormat::kR16f:
      return 2;
    case TexelFormat::kRg16ui:
    case TexelFormat::kRgba8:
    case TexelFormat::kRgba8Snorm:
    case TexelFormat::kRg16f:
      return 4;
    case TexelFormat::kRgba16ui:
    case TexelFormat::kRgba16f:
      return 8;
    case TexelFormat::kRgba32ui:
    case TexelFormat::kRgba32f:
      return 16;
  }
  VENEER_CHECK(false);
}

std::size_t ModelShader::gpu_bytes() const {
  std::size_t bytes = 0;
  for (const ModelTexture& texture : textures) bytes += texture.data.size();
  return bytes;
}

}  // namespace veneer::btf
