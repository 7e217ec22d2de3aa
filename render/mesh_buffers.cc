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

// The layout of glDrawElementsIndirect.
struct Command {
  GLuint count = 0;
  GLuint instances = 1;
  GLuint first = 0;
  GLint base_vertex = 0;
  GLuint base_instance = 0;
};

// A vertex array in the order of the locations in draw.vert.
GlVertexArray make_array(const GlBuffer& vertices, const GlBuffer& indices) {
  struct Attribute {
    int components;
    std::size_t offset;
  };
  constexpr Attribute kAttributes[] = {{3, offsetof(Vertex, position)},
                                       {3, offsetof(Vertex, normal)},
                                       {3, offsetof(Vertex, tangent)},
                                       {2, offsetof(Vertex, texture_coordinate)}};
  GlVertexArray array = make_vertex_array();
  glVertexArrayVertexBuffer(array.id(), 0, vertices.id(), 0, sizeof(Vertex));
  glVertexArrayElementBuffer(array.id(), indices.id());
  GLuint location = 0;
  for (const auto& [components, offset] : kAttributes) {
    glEnableVertexArrayAttrib(array.id(), location);
    glVertexArrayAttribFormat(
        array.id(), location, components, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
    glVertexArrayAttribBinding(array.id(), location, 0);
    ++location;
  }
  return array;
}

}  // namespace

MeshBuffers::MeshBuffers(const Mesh& mesh)
    : vertices_(upload(vertices_of(mesh))),
      indices_(upload(mesh.triangles)),
      array_(make_array(vertices_, indices_)),
      index_count_(static_cast<GLsizei>(3 * mesh.triangles.size())) {
  const std::size_t bytes = 2 * static_cast<std::size_t>(index_count_) * sizeof(std::uint32_t);
  sorted_ = make_buffer(nullptr, bytes, 0);
  sorted_array_ = make_array(vertices_, sorted_);
  commands_ = make_buffer(nullptr, 2 * sizeof(Command), GL_DYNAMIC_STORAGE_BIT);
}

void MeshBuffers::draw() const {
  glBindVertexArray(array_.id());
  glDrawElements(GL_TRIANGLES, index_count_, GL_UNSIGNED_INT, nullptr);
}

void MeshBuffers::sort() const {
  constexpr GLuint kGroup = 64;  // local size of cache_sort.comp
  const Command empty[2] = {{}, {.first = static_cast<GLuint>(index_count_)}};
  glNamedBufferSubData(commands_.id(), 0, sizeof(empty), empty);
  GLuint binding = 0;
  for (const GlBuffer* buffer : {&vertices_, &indices_, &sorted_, &commands_})
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding++, buffer->id());
  glDispatchCompute((static_cast<GLuint>(index_count_) / 3 + kGroup - 1) / kGroup, 1, 1);
  glMemoryBarrier(GL_ELEMENT_ARRAY_BARRIER_BIT | GL_COMMAND_BARRIER_BIT);
}

void MeshBuffers::draw_sorted(List list) const {
  glBindVertexArray(sorted_array_.id());
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands_.id());
  const std::size_t offset = list == List::kCached ? 0 : sizeof(Command);
  glDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, reinterpret_cast<const void*>(offset));
}

double MeshBuffers::served() const {
  Command cached;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glGetNamedBufferSubData(commands_.id(), 0, sizeof(cached), &cached);
  return static_cast<double>(cached.count) / static_cast<double>(index_count_);
}

}  // namespace veneer::render
