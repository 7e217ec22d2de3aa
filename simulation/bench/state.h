// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

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
  SurfaceLight on_object;

  State(const BenchTruth& bench_truth, Mesh object);
  [[nodiscard]] EyeSample light(const MeshPoint& point,
                                const RigidTransform& world_from_object,
                                const Eigen::Vector3d& lens_in_object) const;
};

}  // namespace veneer::simulation
