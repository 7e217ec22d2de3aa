// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace veneer::btf {

/// GLSL for EigenCache of models with RGB Eigen-BRDFs: their colours stand one after the other in
/// four-vectors. Written out for each component, because software rasterisers keep arrays that are
/// indexed by variables in memory.

/// Four-vectors that hold the colours of so many Eigen-BRDFs.
[[nodiscard]] constexpr int eigen_rgb_layers(int components) { return (3 * components + 3) / 4; }
/// The colour of a component in `vec4 eigen[...]`.
[[nodiscard]] std::string eigen_rgb(int component);
/// Statements that fill `out vec4 values[...]` from `vec3 brdf0, brdf1, ...`.
[[nodiscard]] std::string fill_eigen_rgb(int components);
/// `cached_eigen(cluster, ...)` for all layers into `vec4 eigen[...]`, which it declares.
[[nodiscard]] std::string fetch_eigen_rgb(int components);

}  // namespace veneer::btf
