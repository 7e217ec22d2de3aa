// SPDX-License-Identifier: Apache-2.0
#include "base/mesh.h"

#include <Eigen/Geometry>
#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>
#include <string_view>

namespace veneer {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct SurfacePoint {
  Vector3d position;
  Vector3d normal;
};

/// A grid over u, v in [0, 1]; `surface(u, v)` must run anticlockwise: right with u, down with v.
Mesh tessellate(int columns,
                int rows,
                const std::function<SurfacePoint(double u, double v)>& surface) {
  Mesh mesh;
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const double u = static_cast<double>(i) / columns;
      const double v = static_cast<double>(j) / rows;
      const SurfacePoint point = surface(u, v);
      mesh.positions.push_back(point.position);
      mesh.normals.push_back(point.normal);
      mesh.texture_coordinates.emplace_back(u, v);
    }
  }
  const auto vertex = [columns](int i, int j) {
    return static_cast<std::uint32_t>(j * (columns + 1) + i);
  };
  const auto add = [&mesh](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    // At a pole a row has shrunk to a point and half of its triangles have no area.
    const Vector3d& p = mesh.positions[a];
    if ((mesh.positions[b] - p).cross(mesh.positions[c] - p).norm() > 1e-12)
      mesh.triangles.push_back({a, b, c});
  };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      add(vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1));
      add(vertex(i, j), vertex(i + 1, j + 1), vertex(i + 1, j));
    }
  }
  return mesh;
}

Mesh make_plate() {
  static constexpr double kSide = 0.2;
  return tessellate(16, 16, [](double u, double v) {
    return SurfacePoint{{kSide * (u - 0.5), kSide * (0.5 - v), 0}, Vector3d::UnitZ()};
  });
}

Mesh make_sphere() {
  static constexpr double kRadius = 0.1;
  return tessellate(128, 64, [](double u, double v) {
    // u = 0.5 faces +z; the seam is at the back.
    const double azimuth = 2 * std::numbers::pi * (u - 0.5);
    const double polar = std::numbers::pi * v;
    const Vector3d normal(
        std::sin(polar) * std::sin(azimuth), std::cos(polar), std::sin(polar) * std::cos(azimuth));
    return SurfacePoint{kRadius * normal, normal};
  });
}

/// Without ends, so that its texture is stretched nowhere.
Mesh make_cylinder() {
  static constexpr double kRadius = 0.05;
  static constexpr double kHeight = 0.2;
  return tessellate(128, 16, [](double u, double v) {
    const double azimuth = 2 * std::numbers::pi * (u - 0.5);
    const Vector3d normal(std::sin(azimuth), 0, std::cos(azimuth));
    return SurfacePoint{kRadius * normal + kHeight * (0.5 - v) * Vector3d::UnitY(), normal};
  });
}

/// A solid of revolution about y whose outline swells, narrows at the neck and opens again.
Mesh make_vase() {
  constexpr double kHeight = 0.25;
  const auto radius = [](double y) {
    const double t = y / kHeight + 0.5;
    return 0.055 + 0.030 * std::sin(1.6 * std::numbers::pi * t + 0.25) + 0.008 * t;
  };
  return tessellate(128, 128, [radius](double u, double v) {
    const double azimuth = 2 * std::numbers::pi * (u - 0.5);
    const double y = kHeight * (0.5 - v);
    constexpr double kStep = 1e-6;
    const double slope = (radius(y + kStep) - radius(y - kStep)) / (2 * kStep);
    const Vector3d outward(std::sin(azimuth), 0, std::cos(azimuth));
    return SurfacePoint{radius(y) * outward + y * Vector3d::UnitY(),
                        (outward - slope * Vector3d::UnitY()).normalized()};
  });
}

struct BuiltIn {
  std::string_view name;
  Mesh (*make)();
};
constexpr std::array kBuiltIns{BuiltIn{"plate", &make_plate},
                               BuiltIn{"cylinder", &make_cylinder},
                               BuiltIn{"sphere", &make_sphere},
                               BuiltIn{"vase", &make_vase}};

Vector3d to_eigen(const aiVector3D& v) { return {v.x, v.y, v.z}; }

Status append(const aiMesh& part, const std::string& origin, Mesh& mesh) {
  if ((part.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0) return {};  // only points or lines
  if (!part.HasTextureCoords(0)) {
    return fail(
        Errc::kBadFormat,
        "reading {}: the part \"{}\" has no texture coordinates, so no material can be laid on it; "
        "unwrap it (in Blender: UV > Smart UV Project) and export it again",
        origin,
        part.mName.C_Str());
  }
  if (!part.HasNormals()) {
    return fail(Errc::kBadFormat,
                "reading {}: the part \"{}\" has no normals, and none follow from its triangles",
                origin,
                part.mName.C_Str());
  }
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const Vector3d position = to_eigen(part.mVertices[i]);
    const Vector3d normal = to_eigen(part.mNormals[i]);
    const Vector3d uv = to_eigen(part.mTextureCoords[0][i]);
    if (!position.allFinite() || !normal.allFinite() || !uv.allFinite()) {
      return fail(Errc::kBadFormat,
                  "reading {}: vertex {} of \"{}\" is not finite",
                  origin,
                  i,
                  part.mName.C_Str());
    }
    mesh.positions.push_back(position);
    mesh.normals.push_back(normal.norm() > 0 ? normal.normalized() : Vector3d::UnitZ().eval());
    mesh.texture_coordinates.emplace_back(uv.x(), uv.y());
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;  // points and lines that came with normals of their own
    mesh.triangles.push_back(
        {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
  }
  return {};
}

/// A header of PLY that nothing ends is read for ever by assimp 5.2.5: there are two ways to get
/// one, a transfer that was cut off and another letter.
Status check_ply_header(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic(3, '\0');
  file.read(magic.data(), 3);
  std::ranges::transform(
      magic, magic.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (!file || magic != "ply") return {};
  constexpr std::size_t kMostHeader = 1U << 20U;
  std::string header(kMostHeader, '\0');
  file.read(header.data(), static_cast<std::streamsize>(header.size()));
  std::string_view rest(header.data(), static_cast<std::size_t>(file.gcount()));
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find_first_of("\r\n"), rest.size());
    std::string_view line = rest.substr(0, end);
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    if (line.substr(0, line.find_first_of(" \t")) == "end_header") return {};
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return fail(
      Errc::kBadFormat,
      "reading the mesh {}: the header of this PLY file has no line end_header; it may have "
      "been cut off: copy or export it again",
      path);
}

/// The later steps of assimp 5.2.5 end the program where a part has no face, or a face no corner,
/// and read past the vertices where a corner is none of them.
Status check_faces(const aiScene& scene, const std::string& path) {
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
    const aiMesh& part = *scene.mMeshes[i];
    const auto bad = [&](std::string_view why) {
      return fail(Errc::kBadFormat,
                  "reading the mesh {}: in the part \"{}\" {}; export it again",
                  path,
                  part.mName.C_Str(),
                  why);
    };
    if (part.mNumFaces == 0 || part.mNumVertices == 0) return bad("there is no face");
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices == 0) return bad(fmt::format("face {} has no corner", f));
      for (unsigned corner = 0; corner < face.mNumIndices; ++corner) {
        if (face.mIndices[corner] >= part.mNumVertices)
          return bad(fmt::format("face {} names a vertex that is not there", f));
      }
    }
  }
  return {};
}

}  // namespace

Result<Mesh> load_mesh(const std::filesystem::path& path_or_name) {
  for (const BuiltIn& built_in : kBuiltIns) {
    if (path_or_name == built_in.name) return built_in.make();
  }
  const std::string origin = path_or_name.string();
  if (std::error_code error; !std::filesystem::exists(path_or_name, error)) {
    return fail(Errc::kNotFound,
                "reading the mesh {}: there is no such file, and the built-in ones are plate, "
                "cylinder, sphere and vase",
                origin);
  }
  // A pipe or a device would be read for ever.
  if (std::error_code error; !std::filesystem::is_regular_file(path_or_name, error))
    return fail(
        Errc::kBadFormat, "reading the mesh {}: it is a folder or a device; name a file", origin);
  VENEER_TRY(check_ply_header(origin));
  Assimp::Importer importer;
  // Without a name's end that it knows, assimp tries all of its readers, some fifty, on the
  // contents.
  if (const std::string kind = path_or_name.extension().string();
      kind.empty() || !importer.IsExtensionSupported(kind))
    return fail(Errc::kBadFormat,
                "reading the mesh {}: its name does not end with a kind of mesh that is known; "
                "export it as .obj, .ply or .gltf",
                origin);
  // FlipUVs: files count v from the bottom of the texture, Veneer from its first row. SortByPType:
  // points and lines become parts of their own, which may lack texture coordinates and normals.
  const aiScene* scene = importer.ReadFile(origin, 0);
  if (scene != nullptr) {
    VENEER_TRY(check_faces(*scene, origin));
    scene = importer.ApplyPostProcessing(
        aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_GenSmoothNormals |
        aiProcess_JoinIdenticalVertices | aiProcess_PreTransformVertices | aiProcess_FlipUVs);
  }
  if (scene == nullptr)
    return fail(Errc::kBadFormat, "reading the mesh {}: {}", origin, importer.GetErrorString());
  Mesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i)
    VENEER_TRY(append(*scene->mMeshes[i], origin, mesh));
  if (mesh.triangles.empty())
    return fail(Errc::kBadFormat, "reading the mesh {}: it has no triangles", origin);
  return mesh;
}

}  // namespace veneer
