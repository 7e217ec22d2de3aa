// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

#include "base/result.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "render/renderer.h"
#include "render/scene.h"

namespace veneer::render {

/// What one drawn pixel asks of the material.
struct ScreenQuery {
  int pixel = 0;        ///< row * width + column
  double geometry = 0;  ///< cos(theta_p) (r_ref / r)^2 towards the projector, > 0
  /// The texels that it sees and the share of each; the shares add up to 1.
  struct Share {
    int texel;
    double part;
  };
  std::vector<Share> shares;
  btf::Direction view = btf::Direction::UnitZ();  ///< may be below the horizon
  struct Arriving {
    btf::Direction direction;  ///< may be below the horizon
    Eigen::Vector3d rgb;       ///< what a sample of 1 sends, linear sRGB in cd/m^2
  };
  std::vector<Arriving> lights;
};

struct ScreenProbeOptions {
  int width = 1;      ///< of the sample, texels
  int height = 1;     ///< of the sample, texels
  int pixels = 2000;  ///< that are asked for, of those that are covered; > 0
  /// Along each side of a pixel: rays x rays spread evenly over it see what they hit, all from its
  /// centre's directions. 1 sees the texel at its centre. > 0.
  int rays = 1;
};

struct ProbedScreen {
  std::vector<ScreenQuery> queries;
  std::int64_t covered = 0;  ///< pixels of the whole raster
  /// Looked at and left out: with one ray, those so near the edge of a texel that rounding
  /// decides; with more, those with a neighbour that is not covered or shows another part of the
  /// surface, since what such a pixel sees is not known from its centre.
  std::int64_t at_edges = 0;
  std::int64_t unsound = 0;  ///< left out as well: the mesh gives no direction there
};

/// Reads back from the GPU what `pixels` pixels ask from each viewpoint, one stratum of the covered
/// ones each. Makes a context of its own. Errors: kBadFormat (scene), kInvalidOption (options),
/// kUnavailable (no GL 4.5).
[[nodiscard]] Result<std::vector<ProbedScreen>> probe_scene(
    const Scene& scene,
    const calibration::ProjectorProfile& profile,
    std::span<const FrameInput> viewpoints,
    const ScreenProbeOptions& options);

/// What rays x rays over a pixel see of width x height texels around uv, in repeats; `right`
/// and `down` are how far uv moves from pixel to pixel. All finite.
[[nodiscard]] std::vector<ScreenQuery::Share> shares_of(const Eigen::Vector2d& uv,
                                                        const Eigen::Vector2d& right,
                                                        const Eigen::Vector2d& down,
                                                        int width,
                                                        int height,
                                                        int rays);

/// The full set at each query under all its lights, in double precision: linear sRGB, cd/m^2.
[[nodiscard]] std::vector<Eigen::Vector3d> reference_at(const btf::InterpolatedSet& set,
                                                        std::span<const ScreenQuery> queries);

}  // namespace veneer::render
