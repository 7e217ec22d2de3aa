// SPDX-License-Identifier: Apache-2.0
#include "btf/models/direction_lookup.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/result.h"
#include "btf/elevated_concentric.h"
#include "btf/models/concentric_square.h"

namespace veneer::btf {
namespace {

// Regions side by side in a row of their texture, four texels each.
constexpr int kRegionsPerRow = 64;
constexpr int kTexelsPerRegion = 4;
// Keeps the quotient defined where the border is the horizon; far under any measured cosine.
constexpr double kLeastCosine = 1e-6;
// A weight this small is rounding.
constexpr double kNoWeight = 1e-7;
// Weights that agree so far were found in the same way.
constexpr double kSameWeight = 1e-6;

int cell_of(const Direction& direction) {
  const Eigen::Vector2d st = concentric_square(direction);
  const auto cell = [](double s) {
    return std::min(static_cast<int>(s * DirectionLookup::kSide), DirectionLookup::kSide - 1);
  };
  return cell(st.y()) * DirectionLookup::kSide + cell(st.x());
}

}  // namespace

DirectionLookup::DirectionLookup(const DirectionSet& directions, DirectionRole role) : role_(role) {
  const SphericalInterpolator reference(directions, role);
  add_triangles(directions, reference);
  const std::size_t triangles = regions_.size();

  std::map<std::pair<int, int>, std::size_t> edge_regions;
  cells_.resize(static_cast<std::size_t>(kSide) * kSide);
  for (int cell = 0; cell < kSide * kSide; ++cell) {
    const int row = cell / kSide;
    const Direction centre =
        direction_from_square({(cell % kSide + 0.5) / kSide, (row + 0.5) / kSide});
    std::size_t region = 0;
    while (region < triangles &&
           (regions_[region].weights_from_direction.cast<double>() * centre).minCoeff() <
               -kNoWeight)
      ++region;
    if (region == triangles) {
      const DirectionWeights exact = reference.weights(centre);
      const auto along = edge_region(directions, centre, exact);
      const std::pair edge{exact.index[0], exact.index[1]};
      const auto known = along ? edge_regions.find(edge) : edge_regions.end();
      region = known != edge_regions.end() ? known->second : regions_.size();
      if (region == regions_.size()) {
        regions_.push_back(along ? *along : fixed_region(directions, centre, exact));
        if (along) edge_regions[edge] = region;
      }
    }
    VENEER_CHECK(region <= 0xFFFF);
    cells_[static_cast<std::size_t>(cell)] = static_cast<std::uint16_t>(region);
  }
}

void DirectionLookup::add_triangles(const DirectionSet& directions,
                                    const SphericalInterpolator& reference) {
  const auto at = [&](int i) -> const Direction& {
    return directions[static_cast<std::size_t>(i)];
  };
  const auto edge = [](const std::array<int, 3>& triangle, std::size_t i) -> std::pair<int, int> {
    return std::minmax(triangle[i], triangle[(i + 1) % 3]);
  };
  std::map<std::pair<int, int>, int> uses;
  for (const auto& triangle : reference.triangles())
    for (std::size_t i = 0; i < 3; ++i) ++uses[edge(triangle, i)];

  for (const auto& triangle : reference.triangles()) {
    Region region{.index = triangle};
    Eigen::Matrix3d corners;
    for (std::size_t i = 0; i < 3; ++i) {
      corners.col(static_cast<Eigen::Index>(i)) = at(triangle[i]);
      const auto [a, b] = edge(triangle, i);
      if (role_ == DirectionRole::kLight && uses[{a, b}] == 1)
        region.border_cosines.setConstant(static_cast<float>(std::min(at(a).z(), at(b).z())));
    }
    region.weights_from_direction = corners.inverse().cast<float>();
    regions_.push_back(region);
  }
}

// Beyond a border edge: the weights of its point at the direction's azimuth. Nothing where the
// reference does otherwise at `centre`.
std::optional<DirectionLookup::Region> DirectionLookup::edge_region(
    const DirectionSet& directions, const Direction& centre, const DirectionWeights& exact) const {
  Region region = fixed_region(directions, centre, exact);
  Eigen::Matrix2d edge;
  for (int i = 0; i < 2; ++i)
    edge.col(i) =
        directions[static_cast<std::size_t>(region.index[static_cast<std::size_t>(i)])].head<2>();
  if (!(std::abs(edge.determinant()) > kNoWeight)) return {};
  const Eigen::Matrix2d inverse = edge.inverse();
  const Eigen::Vector2d weight = inverse * centre.head<2>();
  if (weight.minCoeff() < -kNoWeight ||
      std::abs(weight[0] / weight.sum() - exact.weight[0]) > kSameWeight)
    return {};
  region.weights_from_direction.setZero();
  region.weights_from_direction.topLeftCorner<2, 2>() = inverse.cast<float>();
  return region;
}

// The weights at `centre` for a whole cell.
DirectionLookup::Region DirectionLookup::fixed_region(const DirectionSet& directions,
                                                      const Direction& centre,
                                                      const DirectionWeights& exact) const {
  Region region{.index = exact.index};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    region.weights_from_direction.row(row) = (exact.weight[i] * centre).cast<float>();
    if (role_ == DirectionRole::kLight)
      region.border_cosines[row] =
          static_cast<float>(directions[static_cast<std::size_t>(exact.index[i])].z());
  }
  return region;
}

DirectionWeights DirectionLookup::weights(const Direction& direction) const {
  const Region& region = regions_[cells_[static_cast<std::size_t>(cell_of(direction))]];
  Eigen::Vector3d weight = region.weights_from_direction.cast<double>() * direction;
  weight /= weight.sum();
  if (role_ == DirectionRole::kView) return {region.index, {weight[0], weight[1], weight[2]}, 1.0};
  const double border = std::max(weight.dot(region.border_cosines.cast<double>()), kLeastCosine);
  return {region.index,
          {weight[0], weight[1], weight[2]},
          std::clamp(direction.z() / border, 0.0, 1.0)};
}

void DirectionLookup::add_textures(const std::string& name,
                                   std::vector<ModelTexture>& textures) const {
  ModelTexture cells{.sampler = name + "Cells",
                     .kind = TextureKind::k2D,
                     .format = TexelFormat::kR16ui,
                     .width = kSide,
                     .height = kSide};
  cells.data = texture_data(cells_);
  textures.push_back(std::move(cells));

  const int rows = (static_cast<int>(regions_.size()) + kRegionsPerRow - 1) / kRegionsPerRow;
  ModelTexture regions{.sampler = name + "Regions",
                       .kind = TextureKind::k2D,
                       .format = TexelFormat::kRgba32f,
                       .width = kRegionsPerRow * kTexelsPerRegion,
                       .height = rows};
  std::vector<float> values(static_cast<std::size_t>(regions.width) *
                            static_cast<std::size_t>(rows) * 4);
  auto out = values.begin();
  for (const Region& region : regions_) {
    for (int i = 0; i < 3; ++i) {
      out = std::ranges::copy(region.weights_from_direction.row(i), out).out;
      *out++ = region.border_cosines[i];
    }
    for (const int index : region.index) *out++ = static_cast<float>(index);
    *out++ = 0.0F;
  }
  regions.data = texture_data(values);
  textures.push_back(std::move(regions));
}

}  // namespace veneer::btf
