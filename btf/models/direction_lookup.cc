// SPDX-License-Identifier: Apache-2.0
#include "btf/models/direction_lookup.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "btf/elevated_concentric.h"
#include "btf/models/concentric_square.h"

namespace veneer::btf {
namespace {

// Regions side by side in a row of their texture, four texels each.
constexpr int kRegionsPerRow = 64;
constexpr int kTexelsPerRegion = 4;
// Keeps quotients defined at the horizon; far under any measured cosine.
constexpr double kLeastCosine = 1e-6;
// Weights that are the same in a whole cell are rounded to this part, so that cells share them.
constexpr double kFixedSteps = 1000.0;
// Cells that must fit across a triangle for its weights to be linear in them.
constexpr double kThinCells = 2.0;
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

DirectionLookup::Region region_of(const std::array<int, 3>& index,
                                  const Eigen::Matrix3d& weights_from_direction,
                                  const Eigen::Vector3d& border_cosines) {
  DirectionLookup::Region region{};
  auto out = region.begin();
  for (int i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis)
      *out++ = static_cast<float>(weights_from_direction(i, axis));
    *out++ = static_cast<float>(border_cosines[i]);
  }
  std::ranges::transform(index, out, [](int i) { return static_cast<float>(i); });
  return region;
}

// The weights at a cell's centre for every direction: all along the normal.
Eigen::Matrix3d fixed_weights(const DirectionWeights& exact) {
  Eigen::Matrix3d fixed = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 3; ++i)
    fixed(static_cast<Eigen::Index>(i), 2) = std::round(exact.weight[i] * kFixedSteps);
  return fixed;
}

// Whether a weight goes from 1 to 0 within about a cell, so that it would mean nothing beyond it.
bool is_thin(const Eigen::Matrix3d& weights_from_direction) {
  const double cell = std::sqrt(2.0 * std::numbers::pi) / DirectionLookup::kSide;  // equal areas
  return !(weights_from_direction.rowwise().norm().maxCoeff() * kThinCells * cell < 1.0);
}

}  // namespace

DirectionLookup::DirectionLookup(const DirectionSet& directions, DirectionRole role) : role_(role) {
  const SphericalInterpolator reference(directions, role);
  const std::map<std::array<int, 3>, Triangle> triangles = find_triangles(directions, reference);
  std::map<Region, std::uint16_t> known;
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      const Direction centre = direction_from_square({(column + 0.5) / kSide, (row + 0.5) / kSide});
      const DirectionWeights exact = reference.weights(centre);
      const auto triangle = triangles.find(exact.index);
      const Region region =
          triangle == triangles.end() ? border_region(directions, centre, exact)
          : is_thin(triangle->second.weights)
              ? region_of(exact.index, fixed_weights(exact), triangle->second.cosines)
              : region_of(exact.index, triangle->second.weights, triangle->second.cosines);
      // There are no more regions than cells, so 16 bits hold every number.
      const auto [entry, added] =
          known.emplace(region, static_cast<std::uint16_t>(regions_.size()));
      if (added) regions_.push_back(region);
      cells_.push_back(entry->second);
    }
}

std::map<std::array<int, 3>, DirectionLookup::Triangle> DirectionLookup::find_triangles(
    const DirectionSet& directions, const SphericalInterpolator& reference) const {
  const auto at = [&](int i) -> const Direction& {
    return directions[static_cast<std::size_t>(i)];
  };
  const auto edge = [](const std::array<int, 3>& triangle, std::size_t i) -> std::pair<int, int> {
    return std::minmax(triangle[i], triangle[(i + 1) % 3]);
  };
  std::map<std::pair<int, int>, int> uses;
  for (const auto& triangle : reference.triangles())
    for (std::size_t i = 0; i < 3; ++i) ++uses[edge(triangle, i)];

  std::map<std::array<int, 3>, Triangle> triangles;
  for (const auto& triangle : reference.triangles()) {
    Eigen::Matrix3d corners;
    Eigen::Vector3d cosines = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      corners.col(static_cast<Eigen::Index>(i)) = at(triangle[i]);
      const auto [a, b] = edge(triangle, i);
      if (role_ == DirectionRole::kLight && uses[{a, b}] == 1)
        cosines.setConstant(std::min(at(a).z(), at(b).z()));
    }
    triangles[triangle] = {corners.inverse(), cosines};
  }
  return triangles;
}

DirectionLookup::Region DirectionLookup::border_region(const DirectionSet& directions,
                                                       const Direction& centre,
                                                       const DirectionWeights& exact) const {
  const auto at = [&](std::size_t i) -> const Direction& {
    return directions[static_cast<std::size_t>(exact.index[i])];
  };
  Eigen::Vector3d cosines = Eigen::Vector3d::Zero();
  if (role_ == DirectionRole::kLight) cosines = {at(0).z(), at(1).z(), at(2).z()};

  // The weights of the edge's point at the direction's azimuth, if the reference takes that too.
  Eigen::Matrix2d edge;
  edge << at(0).head<2>(), at(1).head<2>();
  if (std::abs(edge.determinant()) > kNoWeight) {
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
    matrix.topLeftCorner<2, 2>() = edge.inverse();
    const Eigen::Vector3d weight = matrix * centre;
    if (weight.minCoeff() >= -kNoWeight &&
        std::abs(weight[0] / weight.sum() - exact.weight[0]) <= kSameWeight)
      return region_of(exact.index, matrix, cosines);
  }
  return region_of(exact.index, fixed_weights(exact), cosines);
}

DirectionWeights DirectionLookup::weights(const Direction& direction) const {
  const Region& region = regions_[cells_[static_cast<std::size_t>(cell_of(direction))]];
  const Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>> texels(region.data());
  const Direction above(direction.x(), direction.y(), std::max(direction.z(), kLeastCosine));
  Eigen::Vector3d weight = (texels.topLeftCorner<3, 3>().cast<double>() * above).cwiseMax(0.0);
  const double sum = weight.sum();
  weight = sum > 0.0 ? Eigen::Vector3d(weight / sum) : Eigen::Vector3d::UnitX();
  DirectionWeights result{.index = {}, .weight = {weight[0], weight[1], weight[2]}, .scale = 1.0};
  for (std::size_t i = 0; i < 3; ++i)
    result.index[i] = static_cast<int>(texels(3, static_cast<Eigen::Index>(i)));
  if (role_ == DirectionRole::kLight) {
    const double border = weight.dot(texels.col(3).head<3>().cast<double>());
    result.scale = std::clamp(direction.z() / std::max(border, kLeastCosine), 0.0, 1.0);
  }
  return result;
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
  for (const Region& region : regions_) out = std::ranges::copy(region, out).out;
  regions.data = texture_data(values);
  textures.push_back(std::move(regions));
}

}  // namespace veneer::btf
