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

  /// The two lists that cache_sort.comp sorts triangles into.
  enum class List { kCached, kPerPixel };
  /// Runs the program in use, cache_sort.comp, over all triangles.
  void sort() const;
  /// Draws what sort() put into a list.
  void draw_sorted(List list) const;
  /// The part of all triangles that the last sort() put into the list of the cached. Waits for the
  /// GPU; for tests and reports.
  [[nodiscard]] double served() const;

 private:
  GlBuffer vertices_;
  GlBuffer indices_;
  GlVertexArray array_;
  GlVertexArray sorted_array_;
  GlBuffer sorted_;
  GlBuffer commands_;
  GLsizei index_count_;
};

}  // namespace veneer::render
