// SPDX-License-Identifier: Apache-2.0
#include "render/mesh_buffers.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/tangents.h"

namespace veneer::render {
namespace {

struct Vertex {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;
  Eigen::Vector3f tangent;
  Eigen::Vector2f texture_coordinate;
};
static_assert(sizeof(Vertex) == 11 * sizeof(float));

std::vector<Vertex> vertices_of(const Mesh& mesh) {
  const std::vector<Eigen::Vector3d> tangents = vertex_tangents(mesh);
  std::vector<Vertex> vertices(mesh.positions.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    vertices[i] = {mesh.positions[i].cast<float>(),
                   mesh.normals[i].cast<float>(),
                   tangents[i].cast<float>(),
                   mesh.texture_coordinates[i].cast<float>()};
  }
  return vertices;
}

template <class T>
GlBuffer upload(const std::vector<T>& items) {
  return make_buffer(items.data(), items.size() * sizeof(T), 0);
}

}  // namespace

MeshBuffers::MeshBuffers(const Mesh& mesh)
    : vertices_(upload(vertices_of(mesh))),
      indices_(upload(mesh.triangles)),
      array_(make_vertex_array()),
      index_count_(static_cast<GLsizei>(3 * mesh.triangles.size())) {
  glVertexArrayVertexBuffer(array_.id(), 0, vertices_.id(), 0, sizeof(Vertex));
  glVertexArrayElementBuffer(array_.id(), indices_.id());
  struct Attribute {
    int components;
    std::size_t offset;
  };
  // In the order of the locations in draw.vert.
  constexpr Attribute kAttributes[] = {{3, offsetof(Vertex, position)},
                                       {3, offsetof(Vertex, normal)},
                                       {3, offsetof(Vertex, tangent)},
                                       {2, offsetof(Vertex, texture_coordinate)}};
  GLuint location = 0;
  for (const auto& [components, offset] : kAttributes) {
    glEnableVertexArrayAttrib(array_.id(), location);
    glVertexArrayAttribFormat(
        array_.id(), location, components, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
    glVertexArrayAttribBinding(array_.id(), location, 0);
    ++location;
  }
}

void MeshBuffers::draw() const {
  glBindVertexArray(array_.id());
  glDrawElements(GL_TRIANGLES, index_count_, GL_UNSIGNED_INT, nullptr);
}

}  // namespace veneer::render
