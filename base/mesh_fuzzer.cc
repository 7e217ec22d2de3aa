// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include "base/mesh.h"
#include "base/testing/fuzzing.h"
#include "base/testing/temporary_folder.h"

// What assimp loses of a broken file is the library's, and no reason to stop.
extern "C" const char* __lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp"; }

namespace veneer {
namespace {

/// What is accepted is finite, has unit normals, and no triangle names a vertex that is not there.
std::string laws_of(const Mesh& mesh) {
  if (mesh.triangles.empty()) return "a mesh without a triangle";
  if (mesh.normals.size() != mesh.positions.size() ||
      mesh.texture_coordinates.size() != mesh.positions.size())
    return "arrays of different lengths";
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (!mesh.positions[i].allFinite() || !mesh.texture_coordinates[i].allFinite())
      return "a vertex that is not finite";
    if (!(std::abs(mesh.normals[i].norm() - 1) < 1e-6)) return "a normal that is no unit vector";
  }
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle)
      if (corner >= mesh.positions.size()) return "a corner that is no vertex";
  return "";
}

/// The first byte chooses the kind.
std::string read(std::string_view text) {
  static const TemporaryFolder kFolder;
  if (text.empty()) return "";
  constexpr std::array kNames{"mesh.obj", "mesh.ply", "mesh.gltf", "mesh.glb"};
  const std::filesystem::path path =
      kFolder.path() / kNames.at(static_cast<unsigned char>(text[0]) % kNames.size());
  std::ofstream(path, std::ios::binary) << text.substr(1);
  const auto mesh = load_mesh(path);
  std::filesystem::remove(path);
  if (!mesh) return mesh.error().what.empty() ? "a refusal without a text" : "";
  return laws_of(*mesh);
}

}  // namespace

const FuzzedReader& fuzzed_reader() {
  using namespace std::string_literals;
  static const FuzzedReader kReader{
      &read,
      {"\0v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n"s,
       "\0o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1 4/1\nf -1/1 -2/1 -3/1\n"s,
       "\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"s,
       // A face without a corner, and one whose corner is no vertex.
       "\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n0 0 0 0 0\n1\0000 0 1 0\n0 1 0 0 1\n3\0\0 1 2\n"s,
       "\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 -1 2\n"s,
       "\2{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}]}"s,
       "\3glTF"s}};
  return kReader;
}

}  // namespace veneer
