// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/material.h"

namespace veneer::simulation {

TexelSource texel_source(const btf::InterpolatedSet& set) {
  const btf::SampleSetInfo& info = set.set().info();
  return {info.width,
          info.height,
          [&set](int texel, const Eigen::Vector3d& view, const Eigen::Vector3d& light) {
            return set.radiance(texel, view, light);
          }};
}

TexelSource texel_source(const btf::Material& material) {
  return {material.width(),
          material.height(),
          [&material](int texel, const Eigen::Vector3d& view, const Eigen::Vector3d& light) {
            return material.radiance(texel, view, light);
          }};
}

}  // namespace veneer::simulation
