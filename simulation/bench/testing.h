// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <utility>

#include "base/mesh.h"
#include "base/rigid_transform.h"
#include "simulation/bench.h"

namespace veneer::simulation::testing {

/// A bench whose numbers are easy: linear tones, a white surface, no black, ambient or blur; the
/// projector stands 1 m in front of the origin on +z and the eye sees as much as it lights.
inline BenchTruth plain_truth() {
  BenchTruth truth;
  ProjectorTruth& p = truth.projector;
  p.width = 64;
  p.height = 48;
  p.focal_px = {320, 320};
  p.principal_point = {32, 24};
  p.world_from_projector = look_at({0, 0, 1}, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY());
  const double centres[] = {620, 535, 455};
  for (std::size_t c = 0; c < 3; ++c) {
    p.channels[c].exponent = 1;
    p.channels[c].centre_nm = centres[c];
  }
  truth.object.reflectance = {1.0};
  truth.eye.width = 64;
  truth.eye.height = 48;
  truth.eye.vertical_fov_deg = 2 * std::atan(24.0 / 320) * 180 / std::numbers::pi;
  truth.eye.samples = 2;
  return truth;
}

/// plain_truth() with a camera beside the projector and a board of 5 by 4 inner corners.
inline BenchTruth truth_with_camera() {
  BenchTruth truth = plain_truth();
  CameraTruth camera;
  camera.width = 320;
  camera.height = 240;
  camera.focal_px = 900;
  camera.principal_point = {163, 118};
  camera.k1 = -0.2;
  camera.k2 = 0.1;
  camera.world_from_camera =
      look_at({-0.2, 0.1, 1}, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY());
  truth.camera = camera;
  BoardTruth board;
  board.columns = 5;
  board.rows = 4;
  board.square_m = 0.015;
  board.border_m = 0.005;
  board.poses = 8;
  truth.board = board;
  return truth;
}

/// A square in the plane z = `z`, facing +z, u along +x and v along -y.
inline void add_square(Mesh& mesh, double half_side, double z) {
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
    mesh.positions.emplace_back((2 * u - 1) * half_side, (1 - 2 * v) * half_side, z);
    mesh.normals.emplace_back(0, 0, 1);
    mesh.texture_coordinates.emplace_back(u, v);
  }
  mesh.triangles.push_back({base, base + 2, base + 1});
  mesh.triangles.push_back({base, base + 3, base + 2});
}
inline Mesh square(double half_side) {
  Mesh mesh;
  add_square(mesh, half_side, 0);
  return mesh;
}

inline RigidTransform turned(double degrees, const Eigen::Vector3d& axis) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis)),
          Eigen::Vector3d::Zero()};
}

inline Image<Rgb16> uniform_frame(const BenchTruth& truth, const Rgb16& code) {
  return {truth.projector.width, truth.projector.height, code};
}

}  // namespace veneer::simulation::testing
