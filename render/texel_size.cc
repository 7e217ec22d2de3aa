// SPDX-License-Identifier: Apache-2.0
#include "render/texel_size.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <vector>

namespace veneer::render {
namespace {

constexpr double kOutermost = 0.05;  // of the area, at either end

struct Piece {
  double area;        // m^2
  double texel_area;  // m^2 of one texel
};

// The texel area below which this share of the object's area lies. Pieces by texel area.
double quantile(const std::vector<Piece>& pieces, double total, double share) {
  double below = 0;
  for (const Piece& piece : pieces) {
    below += piece.area;
    if (below >= share * total) return piece.texel_area;
  }
  return pieces.back().texel_area;
}

}  // namespace

Result<TexelSize> texel_size_on(const Mesh& mesh,
                                const Eigen::Vector2d& texture_repeats,
                                const Eigen::Vector2i& texels) {
  const double texels_per_uv = std::abs(texture_repeats.prod()) * texels.cast<double>().prod();
  if (!(texels_per_uv > 0.0) || !std::isfinite(texels_per_uv))
    return fail(Errc::kInvalidOption,
                "finding the size of a texel on the object: the sample repeats {} x {} times over "
                "the texture, which leaves no texel on it; correct texture_repeats in the scene",
                texture_repeats.x(),
                texture_repeats.y());
  std::vector<Piece> pieces;
  double area = 0;
  double count = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d& p = mesh.positions[a];
    const double size = (mesh.positions[b] - p).cross(mesh.positions[c] - p).norm() / 2;
    const Eigen::Vector2d& at = mesh.texture_coordinates[a];
    const Eigen::Vector2d first = mesh.texture_coordinates[b] - at;
    const Eigen::Vector2d second = mesh.texture_coordinates[c] - at;
    const double texel_count =
        std::abs(first.x() * second.y() - first.y() * second.x()) / 2 * texels_per_uv;
    const double texel_area = size / texel_count;
    if (!(texel_area > 0.0) || !std::isfinite(texel_area)) continue;
    pieces.push_back({size, texel_area});
    area += size;
    count += texel_count;
  }
  if (pieces.empty())
    return fail(Errc::kBadFormat,
                "finding the size of a texel on the object: no triangle of the mesh has both an "
                "area and one in texture space; unwrap the mesh again and export its texture "
                "coordinates");
  std::ranges::sort(pieces, {}, &Piece::texel_area);
  return TexelSize{.mean_m = std::sqrt(area / count),
                   .low_m = std::sqrt(quantile(pieces, area, kOutermost)),
                   .high_m = std::sqrt(quantile(pieces, area, 1 - kOutermost))};
}

}  // namespace veneer::render
