// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>

#include "simulation/bench.h"
#include "simulation/bench/projector.h"
#include "simulation/bench/traced_mesh.h"

namespace veneer::simulation {

/// XYZ of what one surface sends: for output 1 of each of the projector's lights and for black
/// where G = 1, and for the ambient light.
struct SurfaceLight {
  VirtualProjector::SurfaceOutputs outputs;
  Xyz black;
  Xyz ambient;
};

struct Bench::State {
  BenchTruth truth;
  VirtualProjector projector;
  TracedMesh mesh;
  SurfaceLight on_white;  // a perfect diffuser
  /// Of the object's reflectance and of what is painted on it; without a texture twice the same.
  std::array<SurfaceLight, 2> on_object;

  State(const BenchTruth& bench_truth, Mesh object);
  [[nodiscard]] EyeSample light(const MeshPoint& point,
                                const RigidTransform& world_from_object,
                                const Eigen::Vector3d& lens_in_object) const;
  /// See Bench::reachable.
  [[nodiscard]] bool reachable(const SurfaceLight& surface, const Xyz& xyz, double geometry) const;
};

}  // namespace veneer::simulation
