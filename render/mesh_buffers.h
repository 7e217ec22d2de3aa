// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include "base/mesh.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// A mesh on the GPU with what the local frame needs: position, normal, tangent, texture
/// coordinate, in single precision.
class MeshBuffers {
 public:
  /// @param mesh  indices within range, at least one triangle.
  explicit MeshBuffers(const Mesh& mesh);
  /// Draws all triangles with the program in use.
  void draw() const;

 private:
  GlBuffer vertices_;
  GlBuffer indices_;
  GlVertexArray array_;
  GLsizei index_count_;
};

}  // namespace veneer::render
