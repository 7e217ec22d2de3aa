// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/relief.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace veneer::simulation {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
// How far a secondary ray starts above the surface, in cells: far over the rounding of float
// heights (about 1e-6 cells), far under what a texel can show.
constexpr double kLift = 1e-4;
// A ray in a level groove never leaves; by then it has met everything there is.
constexpr int kMaxTiles = 64;

int wrapped(double index, int count) {
  const double rest = std::fmod(index, count);
  return static_cast<int>(rest < 0.0 ? rest + count : rest) % count;
}

// Steps along an axis: distance to the cell's wall.
double wall_distance(double at, double slope) {
  if (slope > 0.0) return (1.0 - at) / slope;
  if (slope < 0.0) return -at / slope;
  return kNever;
}

// Smallest t in [0, limit] with c + b t + a t^2 = 0 where c > 0, or kNever.
double first_root(double a, double b, double c, double limit) {
  double t = kNever;
  if (a == 0.0) {
    if (b < 0.0) t = -c / b;
  } else {
    const double discriminant = b * b - 4.0 * a * c;
    if (discriminant < 0.0) return kNever;
    // The form without cancellation; q is 0 only where both roots are 0, which c > 0 excludes.
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    for (const double root : {q / a, c / q}) {
      if (root >= 0.0) t = std::min(t, root);
    }
  }
  return t <= limit ? t : kNever;
}

}  // namespace

Relief::Relief(const HeightField& field)
    : resolution_(field.resolution), surfaces_(field.surfaces) {
  const int n = resolution_;
  const double mean =
      std::accumulate(field.heights.begin(), field.heights.end(), 0.0) / (double(n) * n);
  const auto height = [&](int column, int row) {
    const int index = (row % n) * n + column % n;
    return (field.heights[static_cast<std::size_t>(index)] - mean) * n;
  };
  patches_.reserve(field.heights.size());
  top_ = -kNever;
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column < n; ++column) {
      const double h00 = height(column, row);
      const double h10 = height(column + 1, row);
      const double h01 = height(column, row + 1);
      const double h11 = height(column + 1, row + 1);
      // The small margin covers the rounding of the coefficients.
      const double top = std::max({h00, h10, h01, h11}) + 0.01 * kLift;
      patches_.push_back({static_cast<float>(h00),
                          static_cast<float>(h10 - h00),
                          static_cast<float>(h01 - h00),
                          static_cast<float>(h00 - h10 - h01 + h11),
                          static_cast<float>(top)});
      top_ = std::max(top_, top);
    }
  }
}

std::optional<Relief::Hit> Relief::first_hit(const Eigen::Vector3d& from,
                                             const Eigen::Vector3d& direction) const {
  const double dx = direction.x();
  const double dy = direction.y();
  const double dz = direction.z();
  Eigen::Vector3d start = from;
  if (start.z() > top_) {
    if (dz >= 0.0) return std::nullopt;
    start += direction * ((top_ - start.z()) / dz);
  }
  const double left = std::floor(start.x());
  const double up = std::floor(start.y());
  Hit at{wrapped(left, resolution_),
         wrapped(up, resolution_),
         start.x() - left,
         start.y() - up,
         start.z()};

  // Walk from cell to cell; places are kept relative to the cell, so that nothing adds up.
  for (int step = 0; step < 2 * kMaxTiles * resolution_; ++step) {
    const double to_x = wall_distance(at.u, dx);
    const double to_y = wall_distance(at.v, dy);
    const double to_wall = std::min(to_x, to_y);
    const double z_at_wall = to_wall == kNever ? std::copysign(kNever, dz) : at.z + to_wall * dz;
    const Patch& p = patch(at.column, at.row);
    if (std::min(at.z, z_at_wall) <= p.top) {
      // Height of the ray above the patch: gap + rate t + bend t^2.
      const double gap =
          at.z - (p.base + p.slope_u * at.u + p.slope_v * at.v + p.twist * at.u * at.v);
      if (gap <= 0.0) return at;
      const double rate = dz - p.slope_u * dx - p.slope_v * dy - p.twist * (at.u * dy + at.v * dx);
      const double t = first_root(-p.twist * dx * dy, rate, gap, to_wall);
      if (t != kNever) {
        at.u = std::clamp(at.u + t * dx, 0.0, 1.0);
        at.v = std::clamp(at.v + t * dy, 0.0, 1.0);
        at.z += t * dz;
        return at;
      }
    }
    if (dz >= 0.0 && z_at_wall > top_) return std::nullopt;
    at.z = z_at_wall;
    if (to_x <= to_y) {
      at.v = std::clamp(at.v + to_wall * dy, 0.0, 1.0);
      at.u = dx > 0.0 ? 0.0 : 1.0;
      at.column += dx > 0.0 ? 1 : -1;
      if (at.column == resolution_) at.column = 0;
      if (at.column < 0) at.column = resolution_ - 1;
    } else {
      at.u = std::clamp(at.u + to_wall * dx, 0.0, 1.0);
      at.v = dy > 0.0 ? 0.0 : 1.0;
      at.row += dy > 0.0 ? 1 : -1;
      if (at.row == resolution_) at.row = 0;
      if (at.row < 0) at.row = resolution_ - 1;
    }
  }
  return std::nullopt;
}

Eigen::Vector3d Relief::normal(const Hit& hit) const {
  const Patch& p = patch(hit.column, hit.row);
  return Eigen::Vector3d(-(p.slope_u + p.twist * hit.v), -(p.slope_v + p.twist * hit.u), 1.0)
      .normalized();
}

Surface Relief::surface(const Hit& hit) const { return surfaces_[cell(hit.column, hit.row)]; }

Eigen::Vector3d Relief::lifted(const Hit& hit, const Eigen::Vector3d& normal) const {
  return position(hit) + kLift * normal;
}

Relief::Hit Relief::point(int column, int row, double u, double v) const {
  const Patch& p = patch(column, row);
  return {column, row, u, v, p.base + p.slope_u * u + p.slope_v * v + p.twist * u * v};
}

}  // namespace veneer::simulation
