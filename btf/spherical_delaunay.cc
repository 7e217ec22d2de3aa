// SPDX-License-Identifier: Apache-2.0
#include "btf/spherical_delaunay.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>
#include <utility>

namespace veneer::btf {
namespace {

using Triangle = std::array<int, 3>;

// Rounding of a determinant of differences, relative to their lengths; a hundred times what double
// precision leaves.
constexpr double kRounding = 1e-12;

// Whether `d` lies inside the circumcircle of the counter-clockwise triangle (a, b, c): beyond its
// plane. Cocircular within rounding is not inside.
bool in_circle(const Direction& a, const Direction& b, const Direction& c, const Direction& d) {
  const Direction u = b - a;
  const Direction v = c - a;
  const Direction w = d - a;
  return u.cross(v).dot(w) > kRounding * u.norm() * v.norm() * w.norm();
}

// How far the sweep lifts directions off the horizon: far more than rounding, far less than any
// spacing. Great circles through directions on the horizon coincide with it; lifted, the horizon is
// a circle like any other ring, and which edges turn to the border is decided.
constexpr double kLift = 1e-7;

DirectionSet lifted(const DirectionSet& directions) {
  DirectionSet result;
  for (const Direction& d : directions)
    result.push_back(Direction(d.x(), d.y(), std::max(d.z(), 0.0) + kLift).normalized());
  return result;
}

// Order along an axis of the gnomonic plane, in which great circles are lines. The axis points in
// an azimuth at which no measuring device puts samples, so that no two are level.
std::vector<int> sweep_order(const DirectionSet& directions) {
  constexpr double kAxisAzimuth = 0.7548776662466927;  // radians; no simple fraction of a turn
  const Eigen::Vector2d axis(std::cos(kAxisAzimuth), std::sin(kAxisAzimuth));
  std::vector<double> keys;
  for (const Direction& d : directions) keys.push_back(axis.dot(d.head<2>()) / d.z());
  std::vector<int> order(directions.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
  });
  return order;
}

// A triangulation whose triangles may be any shape: every direction of the sweep is joined to the
// part of the border that it sees.
std::vector<Triangle> sweep(const DirectionSet& directions) {
  const auto side = [&](int a, int b, int c) {
    return side_of_arc(directions[static_cast<std::size_t>(a)],
                       directions[static_cast<std::size_t>(b)],
                       directions[static_cast<std::size_t>(c)]);
  };
  std::vector<Triangle> triangles;
  std::vector<int> lower;  // the border's two sides, from the first direction to the newest
  std::vector<int> upper;
  for (const int next : sweep_order(directions)) {
    while (lower.size() > 1 && side(lower[lower.size() - 2], lower.back(), next) < 0.0) {
      triangles.push_back({lower[lower.size() - 2], next, lower.back()});
      lower.pop_back();
    }
    while (upper.size() > 1 && side(upper[upper.size() - 2], upper.back(), next) > 0.0) {
      triangles.push_back({upper[upper.size() - 2], upper.back(), next});
      upper.pop_back();
    }
    lower.push_back(next);
    upper.push_back(next);
  }
  return triangles;
}

// Triangles and, for each directed edge, the triangle to its left.
class FlippableMesh {
 public:
  FlippableMesh(const DirectionSet& directions,
                const DirectionSet& lifted,
                std::vector<Triangle> triangles)
      : directions_(directions), lifted_(lifted), triangles_(std::move(triangles)) {
    for (std::size_t t = 0; t < triangles_.size(); ++t) own(static_cast<int>(t));
  }

  // Lawson 1977: flips the common edge of two triangles while one has a corner of the other inside
  // its circumcircle. Each flip moves the surface of the triangles outwards, so this ends.
  std::vector<Triangle> make_delaunay() && {
    std::vector<std::pair<int, int>> pending;
    for (const Triangle& t : triangles_) {
      for (std::size_t i = 0; i < 3; ++i) pending.emplace_back(t[i], t[(i + 1) % 3]);
    }
    while (!pending.empty()) {
      const std::pair<int, int> edge = pending.back();
      pending.pop_back();
      const auto left = left_of_.find(key(edge.first, edge.second));
      const auto right = left_of_.find(key(edge.second, edge.first));
      if (left == left_of_.end() || right == left_of_.end()) continue;
      const int a = edge.first;
      const int b = edge.second;
      const int c = apex(left->second, a, b);
      const int d = apex(right->second, b, a);
      if (!in_circle(at(a), at(b), at(c), at(d))) continue;
      if (lifted_side(a, d, c) <= 0.0 || lifted_side(d, b, c) <= 0.0) continue;
      flip(left->second, right->second, {a, b, c, d});
      for (const auto& next : {std::pair{a, d}, {d, b}, {b, c}, {c, a}}) pending.push_back(next);
    }
    return std::move(triangles_);
  }

 private:
  [[nodiscard]] const Direction& at(int i) const {
    return directions_[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double lifted_side(int a, int b, int c) const {
    return side_of_arc(lifted_[static_cast<std::size_t>(a)],
                       lifted_[static_cast<std::size_t>(b)],
                       lifted_[static_cast<std::size_t>(c)]);
  }
  static std::uint64_t key(int a, int b) {
    return (static_cast<std::uint64_t>(a) << 32U) | static_cast<std::uint32_t>(b);
  }
  void own(int triangle) {
    const Triangle& t = triangles_[static_cast<std::size_t>(triangle)];
    for (std::size_t i = 0; i < 3; ++i) left_of_[key(t[i], t[(i + 1) % 3])] = triangle;
  }
  [[nodiscard]] int apex(int triangle, int a, int b) const {
    const Triangle& t = triangles_[static_cast<std::size_t>(triangle)];
    return t[0] + t[1] + t[2] - a - b;
  }
  // Replaces (a, b, c) and (b, a, d) by (a, d, c) and (d, b, c).
  void flip(int left, int right, const std::array<int, 4>& abcd) {
    const auto [a, b, c, d] = abcd;
    left_of_.erase(key(a, b));
    left_of_.erase(key(b, a));
    triangles_[static_cast<std::size_t>(left)] = {a, d, c};
    triangles_[static_cast<std::size_t>(right)] = {d, b, c};
    own(left);
    own(right);
  }

  const DirectionSet& directions_;  // both borrowed from triangulate_directions
  const DirectionSet& lifted_;
  std::vector<Triangle> triangles_;
  std::unordered_map<std::uint64_t, int> left_of_;
};

}  // namespace

double side_of_arc(const Direction& a, const Direction& b, const Direction& c) {
  const Direction u = b - a;
  const Direction v = c - a;
  const double side = a.dot(u.cross(v));
  return std::abs(side) <= kRounding * u.norm() * v.norm() ? 0.0 : side;
}

std::vector<std::array<int, 3>> triangulate_directions(const DirectionSet& directions) {
  const DirectionSet raised = lifted(directions);
  std::vector<Triangle> triangles =
      FlippableMesh(directions, raised, sweep(raised)).make_delaunay();
  // What only the lift kept open: three directions of one great circle at the border.
  std::erase_if(triangles, [&](const Triangle& t) {
    return side_of_arc(directions[static_cast<std::size_t>(t[0])],
                       directions[static_cast<std::size_t>(t[1])],
                       directions[static_cast<std::size_t>(t[2])]) <= 0.0;
  });
  return triangles;
}

}  // namespace veneer::btf
