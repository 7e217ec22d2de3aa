// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <span>
#include <vector>

#include "btf/interpolated_set.h"
#include "render/draw_pass.h"

namespace veneer::render {

/// What one drawn pixel asks of the material.
struct ScreenQuery {
  int pixel;  ///< row * width + column
  int texel;
  btf::Direction view;
  btf::Direction light;
};

/// Reads back from the GPU what about `wanted` of the pixels ask, spread over those that a mesh
/// covers, under one directional light. Pixels so near the edge of a texel that rounding decides
/// are left out. Needs a current context. Errors: kUnavailable.
[[nodiscard]] Result<std::vector<ScreenQuery>> probe_screen(
    const MeshBuffers& mesh,
    const DrawInput& input,
    const DirectionalLight& light,
    const Eigen::Vector2d& repeats,
    const calibration::ProjectorProfile& profile,
    const btf::SampleSetInfo& set,
    int wanted);

/// Sums of |drawn - reference| in the sample's unit, both cut to [0, 1] and encoded with 1/2.2.
struct ScreenError {
  double sum = 0;
  double squares = 0;
  std::size_t count = 0;  ///< of values: three for each pixel

  [[nodiscard]] double epsilon() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
  [[nodiscard]] double rmse() const;
};

/// The full set at each query, in double precision.
[[nodiscard]] std::vector<Eigen::Vector3d> reference_at(const btf::InterpolatedSet& set,
                                                        std::span<const ScreenQuery> queries);

/// @param target  what DrawPass left, XYZ and G for each pixel.
void add_error(std::span<const Eigen::Vector4f> target,
               std::span<const ScreenQuery> queries,
               std::span<const Eigen::Vector3d> reference,
               const DirectionalLight& light,
               ScreenError& error);

}  // namespace veneer::render
