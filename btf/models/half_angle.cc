// SPDX-License-Identifier: Apache-2.0
#include "btf/models/half_angle.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "base/result.h"

namespace veneer::btf::half_angle {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Triplet = Eigen::Triplet<double>;

// Every GL 4.5 takes volumes of this many texels a side.
constexpr int kMostSide = 2048;
// Squares under this are 0: keeps quotients defined at the poles.
constexpr double kLeastSquare = 1e-12;
// Weight of the squared difference of neighbouring nodes, against a measured pair's 1: fills what
// no pair tells, and is too weak to move what one does.
constexpr double kEvenness = 1e-3;

int index_of(int u, int v, int w) {
  // At the poles there is no azimuth.
  const int azimuth = u == 0 || v == 0 ? 0 : w;
  return (azimuth * kDifferenceNodes + v) * kHalfNodes + u;
}

// [pair][node]: the functions at measured pairs are this times g.
Sparse design(const DirectionSet& views, const DirectionSet& lights) {
  std::vector<Triplet> entries;
  int pair = 0;
  for (const Direction& view : views)
    for (const Direction& light : lights) {
      const NodeWeights at = weights(view, light);
      for (std::size_t i = 0; i < at.node.size(); ++i)
        entries.emplace_back(pair, at.node[i], light.z() * at.weight[i]);
      ++pair;
    }
  Sparse matrix(pair, kNodes);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// The sum of squared differences of neighbours, as a quadratic form. Unused nodes at the poles are
// on the diagonal, so that the form can be solved.
Sparse unevenness() {
  std::vector<Triplet> entries;
  const auto differ = [&](int a, int b) {
    if (a == b) return;
    for (const auto& [row, column, sign] :
         {std::tuple(a, a, 1.0), {b, b, 1.0}, {a, b, -1.0}, {b, a, -1.0}})
      entries.emplace_back(row, column, sign);
  };
  for (int w = 0; w < kAzimuthNodes; ++w)
    for (int v = 0; v < kDifferenceNodes; ++v)
      for (int u = 0; u < kHalfNodes; ++u) {
        const int here = index_of(u, v, w);
        const int own = (w * kDifferenceNodes + v) * kHalfNodes + u;
        if (own != here) entries.emplace_back(own, own, 1.0);
        if (u + 1 < kHalfNodes) differ(here, index_of(u + 1, v, w));
        if (v + 1 < kDifferenceNodes) differ(here, index_of(u, v + 1, w));
        if (w + 1 < kAzimuthNodes) differ(here, index_of(u, v, w + 1));
      }
  Sparse matrix(kNodes, kNodes);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace

Eigen::Vector3d coordinates(const Direction& view, const Direction& light) {
  const Direction above(view.x(), view.y(), std::max(view.z(), 0.0));
  const Eigen::Vector3d sum = above + light;
  const Eigen::Vector3d apart = above - light;
  const double sum_square = std::max(sum.squaredNorm(), kLeastSquare);
  const double apart_square = apart.squaredNorm();
  const double cos_half = sum.z() / std::sqrt(sum_square);
  const double sin_half_square = sum.head<2>().squaredNorm() / sum_square;
  const double u = std::sqrt(sin_half_square / (1.0 + cos_half));
  const double v = 0.5 * std::sqrt(apart_square / (1.0 + 0.5 * std::sqrt(sum_square)));
  const double w = apart.z() * apart.z() / std::max(apart_square * sin_half_square, kLeastSquare);
  return Eigen::Vector3d(u, v, w).cwiseMin(1.0);
}

NodeWeights weights(const Direction& view, const Direction& light) {
  constexpr std::array kSides{kHalfNodes, kDifferenceNodes, kAzimuthNodes};
  const Eigen::Vector3d place = coordinates(view, light);
  std::array<int, 3> low{};
  std::array<double, 3> upper{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = place[static_cast<Eigen::Index>(i)] * (kSides[i] - 1);
    low[i] = std::clamp(static_cast<int>(at), 0, kSides[i] - 2);
    upper[i] = at - low[i];
  }
  NodeWeights result;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    std::array<int, 3> node = low;
    double weight = 1.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const bool up = (corner >> i & 1U) != 0;
      node[i] += up ? 1 : 0;
      weight *= up ? upper[i] : 1.0 - upper[i];
    }
    result.node[corner] = index_of(node[0], node[1], node[2]);
    result.weight[corner] = weight;
  }
  return result;
}

RowMatrix fill(const DirectionSet& views, const DirectionSet& lights, const RowMatrix& values) {
  const Sparse measured = design(views, lights);
  const Sparse normal = Sparse(measured.transpose() * measured) + kEvenness * unevenness();
  // Without any light above the horizon everything would be even, and nothing say how bright.
  Sparse ground(kNodes, kNodes);
  ground.setIdentity();
  const Eigen::SimplicialLDLT<Sparse> solver(normal + 1e-12 * ground);
  VENEER_CHECK(solver.info() == Eigen::Success);
  Eigen::MatrixXd nodes =
      solver.solve(Eigen::MatrixXd(measured.transpose() * values.transpose().cast<double>()));
  // Every azimuth reads its pole.
  for (int w = 0; w < kAzimuthNodes; ++w)
    for (int v = 0; v < kDifferenceNodes; ++v)
      for (int u = 0; u < kHalfNodes; ++u)
        nodes.row((w * kDifferenceNodes + v) * kHalfNodes + u) = nodes.row(index_of(u, v, w));
  return nodes.transpose().cast<float>();
}

RowMatrix values_at(const DirectionSet& views, const DirectionSet& lights, const RowMatrix& nodes) {
  return (design(views, lights) * nodes.transpose().cast<double>()).transpose().cast<float>();
}

Volume::Volume(int clusters) {
  while ((1 << shift_) < clusters && (2 << shift_) * kHalfNodes <= kMostSide) ++shift_;
  rows_ = (clusters + (1 << shift_) - 1) >> shift_;
}

std::size_t Volume::texel_count() const {
  return static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()) *
         static_cast<std::size_t>(depth());
}

std::size_t Volume::texel(int cluster, int node) const {
  const int u = node % kHalfNodes;
  const int v = node / kHalfNodes % kDifferenceNodes;
  const int w = node / (kHalfNodes * kDifferenceNodes);
  const int x = (cluster & ((1 << shift_) - 1)) * kHalfNodes + u;
  const int y = (cluster >> shift_) * kDifferenceNodes + v;
  return (static_cast<std::size_t>(w) * static_cast<std::size_t>(height()) +
          static_cast<std::size_t>(y)) *
             static_cast<std::size_t>(width()) +
         static_cast<std::size_t>(x);
}

std::string Volume::constants() const {
  return fmt::format(
      "const vec3 kHalfAngleNodes = vec3({}, {}, {});\n"
      "const vec3 kHalfAngleSize = vec3({}, {}, {});\n"
      "const uint kHalfAngleMask = {}u;\n"
      "const int kHalfAngleShift = {};\n",
      kHalfNodes,
      kDifferenceNodes,
      kAzimuthNodes,
      width(),
      height(),
      depth(),
      (1 << shift_) - 1,
      shift_);
}

}  // namespace veneer::btf::half_angle
