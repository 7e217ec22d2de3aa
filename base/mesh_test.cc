// SPDX-License-Identifier: Apache-2.0
#include "base/mesh.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

using Eigen::Vector3d;

class BuiltInMesh : public testing::TestWithParam<const char*> {
 protected:
  Mesh mesh_ = load_mesh(GetParam()).value();
};
INSTANTIATE_TEST_SUITE_P(All,
                         BuiltInMesh,
                         testing::Values("plate", "cylinder", "sphere", "vase"),
                         [](const auto& built_in) { return std::string(built_in.param); });

TEST_P(BuiltInMesh, HasAnticlockwiseTrianglesAlongItsNormals) {
  for (const auto& [a, b, c] : mesh_.triangles) {
    const Vector3d face = (mesh_.positions[b] - mesh_.positions[a])
                              .cross(mesh_.positions[c] - mesh_.positions[a])
                              .normalized();
    EXPECT_GT(face.dot(mesh_.normals[a]), 0.9) << a << " " << b << " " << c;
  }
}

TEST_P(BuiltInMesh, IsNotMirroredAndRunsAlongXInFront) {
  // Along u the front runs towards +x, along v downwards.
  for (const auto& [a, b, c] : mesh_.triangles) {
    if (mesh_.normals[a].z() < 0.7) continue;
    const Eigen::Vector2d e1 = mesh_.texture_coordinates[b] - mesh_.texture_coordinates[a];
    const Eigen::Vector2d e2 = mesh_.texture_coordinates[c] - mesh_.texture_coordinates[a];
    const double area = e1.x() * e2.y() - e1.y() * e2.x();
    ASSERT_NE(area, 0);
    const Vector3d p1 = mesh_.positions[b] - mesh_.positions[a];
    const Vector3d p2 = mesh_.positions[c] - mesh_.positions[a];
    EXPECT_GT(((p1 * e2.y() - p2 * e1.y()) / area).x(), 0) << "along u";
    EXPECT_LT(((p2 * e1.x() - p1 * e2.x()) / area).y(), 0) << "along v";
  }
}

TEST_P(BuiltInMesh, HasUnitNormalsThatFitItsFaces) {
  for (const Vector3d& normal : mesh_.normals) EXPECT_NEAR(normal.norm(), 1, 1e-12);
}

TEST(LoadMesh, ReadsAnObjFileAndCountsVFromTheFirstRow) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.obj";
  ASSERT_TRUE(write_text(
      path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n"));
  const Mesh mesh = load_mesh(path).value();
  ASSERT_EQ(mesh.triangles.size(), 1U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(mesh.texture_coordinates[i].y(), 1 - mesh.positions[i].y(), 1e-6);
  }
}

TEST(LoadMesh, SaysHowToAddTextureCoordinates) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "bare.obj";
  ASSERT_TRUE(write_text(path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  const auto mesh = load_mesh(path);
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().code, Errc::kBadFormat);
  EXPECT_NE(mesh.error().what.find("no texture coordinates"), std::string::npos)
      << mesh.error().what;
}

TEST(LoadMesh, SaysThatLinesAloneAreNoSurface) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "lines.obj";
  ASSERT_TRUE(write_text(path, "v 0 0 0\nv 1 0 0\nvt 0 0\nvt 1 0\nl 1/1 2/2\n"));
  const auto mesh = load_mesh(path);
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().code, Errc::kBadFormat);
  EXPECT_NE(mesh.error().what.find("no triangles"), std::string::npos) << mesh.error().what;
}

TEST(LoadMesh, PassesOverLinesBesideItsTriangles) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "both.obj";
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
  // In the triangle's own part, with texture coordinates and without, and in one of their own
  // without texture coordinates.
  for (const char* lines : {"l 1/1 2/2\n", "l 1 2\n", "o stray\nv 2 0 0\nv 3 0 0\nl 4 5\n"}) {
    ASSERT_TRUE(write_text(path, triangle + lines));
    const auto mesh = load_mesh(path);
    ASSERT_TRUE(mesh) << lines << mesh.error().what;
    EXPECT_EQ(mesh->triangles.size(), 1U) << lines;
    EXPECT_EQ(mesh->positions.size(), 3U) << lines;
    for (const Vector3d& normal : mesh->normals) EXPECT_EQ(normal, Vector3d::UnitZ()) << lines;
  }
}

TEST(LoadMesh, DoesNotReadADeviceForEver) {
  for (const char* device : {"/dev/zero", "/dev"}) {
    const auto mesh = load_mesh(device);
    ASSERT_FALSE(mesh) << device;
    EXPECT_EQ(mesh.error().code, Errc::kBadFormat);
    EXPECT_NE(mesh.error().what.find("device"), std::string::npos);
  }
}

// Each of these would keep assimp busy for ever.
TEST(LoadMesh, RefusesAPlyFileWhoseHeaderDoesNotEnd) {
  const TemporaryFolder folder;
  const std::string begin = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n";
  for (const char* name : {"a.ply", "ply"})
    for (const char* rest : {"", "comment end_header\n", "end_headers\n0\n", "END_HEADER\n0\n"}) {
      const auto path = folder.path() / name;
      ASSERT_TRUE(write_text(path, begin + rest));
      const auto mesh = load_mesh(path);
      ASSERT_FALSE(mesh) << rest;
      EXPECT_EQ(mesh.error().code, Errc::kBadFormat);
      EXPECT_NE(mesh.error().what.find("end_header"), std::string::npos) << mesh.error().what;
    }
}

TEST(LoadMesh, RefusesFacesWithoutCornersAndCornersThatAreNoVertex) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.ply";
  for (const auto& [faces, why] : {std::pair{"0\n", "no "},
                                   std::pair{"3 0 -1 2\n", "not there"},
                                   std::pair{"3 0 1 7\n", "not there"}}) {
    ASSERT_TRUE(write_text(
        path,
        std::string("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                    "y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
                    "property list uchar int vertex_indices\nend_header\n"
                    "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n") +
            faces));
    const auto mesh = load_mesh(path);
    ASSERT_FALSE(mesh) << faces;
    EXPECT_NE(mesh.error().what.find(why), std::string::npos) << mesh.error().what;
  }
}

TEST(LoadMesh, ReadsAPlyFileHoweverItsLinesEnd) {
  const TemporaryFolder folder;
  const std::string text =
      "ply\nformat ascii 1.0\ncomment a\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty float s\nproperty float t\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n"
      "3 0 1 2\n";
  std::string windows;
  for (const char c : text) windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
  for (const std::string& file : {text, windows}) {
    const auto path = folder.path() / "a.ply";
    ASSERT_TRUE(write_text(path, file));
    const auto mesh = load_mesh(path);
    ASSERT_TRUE(mesh) << mesh.error().what;
    EXPECT_EQ(mesh->triangles.size(), 1U);
    EXPECT_EQ(mesh->positions.size(), 3U);
  }
}

TEST(LoadMesh, RefusesMissingEmptyAndForeignFiles) {
  const TemporaryFolder folder;
  EXPECT_EQ(load_mesh("no-such-mesh.obj").error().code, Errc::kNotFound);
  ASSERT_TRUE(write_text(folder.path() / "empty.obj", ""));
  EXPECT_EQ(load_mesh(folder.path() / "empty.obj").error().code, Errc::kBadFormat);
  ASSERT_TRUE(write_text(folder.path() / "text.xyz", "hello"));
  EXPECT_EQ(load_mesh(folder.path() / "text.xyz").error().code, Errc::kBadFormat);
  // What assimp could tell by its contents.
  ASSERT_TRUE(write_text(folder.path() / "solid", "solid a\nendsolid a\n"));
  const auto nameless = load_mesh(folder.path() / "solid");
  EXPECT_EQ(nameless.error().code, Errc::kBadFormat);
  EXPECT_NE(nameless.error().what.find("export it as"), std::string::npos) << nameless.error().what;
}

}  // namespace
}  // namespace veneer
