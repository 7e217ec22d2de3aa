// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer {

/// A triangle mesh in its object's frame, metres. Every vertex has a position, a unit normal and a
/// texture coordinate; a triangle's corners run anticlockwise seen from outside. Texture v grows
/// with the row of the texture (v = 0 is its first row).
struct Mesh {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3d> normals;
  std::vector<Eigen::Vector2d> texture_coordinates;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// A mesh from a file of any kind that assimp reads, told by the end of its name, or built in:
/// "sphere" (radius 0.1 m), "plate" (0.2 m square in the xy plane, normal +z), "cylinder" (about y,
/// 0.1 m wide, 0.2 m high, open), "vase" (a solid of revolution about y, 0.25 m high, convex and
/// concave parts). Of these, +u runs along +x where they face +z. Errors: kNotFound, kBadFormat (an
/// unknown kind; no triangles; no texture coordinates: says how to add them; non-finite numbers).
[[nodiscard]] Result<Mesh> load_mesh(const std::filesystem::path& path_or_name);

}  // namespace veneer
