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
  /// The texels that it sees and the share of each; the shares add up to 1.
  struct Share {
    int texel;
    double part;
  };
  std::vector<Share> shares;
  btf::Direction view;
  btf::Direction light;
};

/// Reads back from the GPU what about `wanted` of the pixels ask, spread over those that a mesh
/// covers, under one directional light. With `rays` = 1 a pixel sees the texel at its centre, and
/// pixels so near the edge of a texel that rounding decides are left out. With more, rays x rays
/// spread evenly over the pixel see what they hit, all from its centre's directions; pixels without
/// four covered neighbours are left out. Needs a current context. Errors: kUnavailable.
[[nodiscard]] Result<std::vector<ScreenQuery>> probe_screen(
    const MeshBuffers& mesh,
    const DrawInput& input,
    const DirectionalLight& light,
    const Eigen::Vector2d& repeats,
    const calibration::ProjectorProfile& profile,
    const btf::SampleSetInfo& set,
    int wanted,
    int rays = 1);

/// What rays x rays over a pixel see of width x height texels around uv, in repeats; `right`
/// and `down` are how far uv moves from pixel to pixel.
[[nodiscard]] std::vector<ScreenQuery::Share> shares_of(const Eigen::Vector2d& uv,
                                                        const Eigen::Vector2d& right,
                                                        const Eigen::Vector2d& down,
                                                        int width,
                                                        int height,
                                                        int rays);

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
