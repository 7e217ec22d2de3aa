// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "simulation/bench.h"
#include "simulation/bench/projector.h"
#include "simulation/bench/traced_mesh.h"

namespace veneer::simulation {

/// XYZ of what one surface sends: per output of each channel and for black where G = 1, and for the
/// ambient light.
struct SurfaceLight {
  Eigen::Matrix3d primaries;
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
