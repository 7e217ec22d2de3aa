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

constexpr std::array kNames{"mesh.obj", "mesh.ply", "mesh.gltf", "mesh.glb"};
std::size_t kind_of(std::string_view text) {
  return static_cast<unsigned char>(text[0]) % kNames.size();
}

/// The first byte chooses the kind.
Verdict read(std::string_view text) {
  static const TemporaryFolder kFolder;
  if (text.empty()) return refused("nothing");
  const std::filesystem::path path = kFolder.path() / kNames.at(kind_of(text));
  std::ofstream(path, std::ios::binary) << text.substr(1);
  const auto mesh = load_mesh(path);
  std::filesystem::remove(path);
  if (!mesh) return refused(mesh.error());
  return accepted(laws_of(*mesh));
}

/// A triangle as .gltf, with as many vertices as are told.
std::string gltf(const std::string& buffer, std::int64_t vertices) {
  return fmt::format(
      R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],)"
      R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2}}]}}],)"
      R"("buffers":[{{{0}"byteLength":66}}],"bufferViews":[{{"buffer":0,"byteLength":36}},)"
      R"({{"buffer":0,"byteOffset":36,"byteLength":24}},)"
      R"({{"buffer":0,"byteOffset":60,"byteLength":6}}],"accessors":[)"
      R"({{"bufferView":0,"componentType":5126,"count":{1},"type":"VEC3"}},)"
      R"({{"bufferView":1,"componentType":5126,"count":{1},"type":"VEC2"}},)"
      R"({{"bufferView":2,"componentType":5123,"count":3,"type":"SCALAR"}}]}})",
      buffer,
      vertices);
}

/// With its buffer as text, and with it behind, as .glb has it.
std::string gltf_alone(std::int64_t vertices) {
  return "\2" +
         gltf(R"("uri":"data:application/octet-stream;base64,)"
              "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"
              R"(AAABAAIA",)",
              vertices);
}
std::string glb(std::int64_t vertices) {
  const std::array<float, 15> numbers{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1};
  const std::array<std::uint16_t, 4> corners{0, 1, 2, 0};
  std::string json = gltf("", vertices);
  json.append((4 - json.size() % 4) % 4, ' ');
  std::string text = "\3glTF";
  const auto add = [&text](std::size_t number) {
    const auto value = static_cast<std::uint32_t>(number);
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const std::size_t body = sizeof numbers + sizeof corners;
  add(2);
  add(12 + 8 + json.size() + 8 + body);
  add(json.size());
  text += "JSON" + json;
  add(body);
  text.append("BIN\0", 4);
  text.append(reinterpret_cast<const char*>(numbers.data()), sizeof numbers);
  text.append(reinterpret_cast<const char*>(corners.data()), sizeof corners);
  return text;
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
       gltf_alone(3),
       glb(3)},
      // assimp reads an .obj, and what looks like one whatever its name, by a block of 16 MiB.
      {17 << 20, 128},
      // A face without a corner, and one whose corner is no vertex.
      {"\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n0 0 0 0 0\n1\0000 0 1 0\n0 1 0 0 1\n3\0\0 1 2\n"s,
       "\1ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
       "float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 -1 2\n"s,
       "\2{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}]}"s,
       "\3glTF"s,
       // More vertices than there are bytes.
       gltf_alone(100'000'000),
       glb(100'000'000)}};
  return kReader;
}

}  // namespace veneer
