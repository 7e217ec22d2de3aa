// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <vector>

#include "btf/model_shader.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// The textures that a model's shader reads, on the GPU.
class ModelTextures {
 public:
  /// Errors: kUnavailable where one is larger than this GL takes, where there are too many, or
  /// where its memory does not suffice.
  [[nodiscard]] static Result<ModelTextures> upload(const btf::ModelShader& shader);
  /// Tells a program of the material which unit each sampler reads, counted from 0.
  static void assign_units(const btf::ModelShader& shader, GLuint program);
  void bind() const;

 private:
  std::vector<GlTexture> textures_;
};

}  // namespace veneer::render
