// SPDX-License-Identifier: Apache-2.0
#include "btf/spherical_interpolation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>

#include "btf/spherical_delaunay.h"

namespace veneer::btf {
namespace {

// Cells along each side of the grid of hints: about a third of Bonn's ring spacing, so that a walk
// takes one or two steps.
constexpr int kHintCells = 48;
// A weight this far below 0 is rounding; it moves the result by that part of a sample.
constexpr double kInsideTolerance = 1e-12;

double cross2(const Direction& a, const Direction& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

SphericalInterpolator::SphericalInterpolator(const DirectionSet& directions, DirectionRole role)
    : directions_(directions), role_(role) {
  VENEER_CHECK(!directions_.empty());
  for (const Direction& d : directions_) thetas_.push_back(angles_from_direction(d).theta);
  triangles_ = triangulate_directions(directions_);
  link_triangles();
  find_border();
  if (!triangles_.empty()) fill_hints();
}

void SphericalInterpolator::link_triangles() {
  std::map<std::pair<int, int>, int> left_of;
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i)
      left_of[{triangles_[t][i], triangles_[t][(i + 1) % 3]}] = static_cast<int>(t);
  }
  for (const auto& triangle : triangles_) {
    Cell cell;
    Eigen::Matrix3d corners;
    for (std::size_t i = 0; i < 3; ++i) {
      corners.col(static_cast<Eigen::Index>(i)) =
          directions_[static_cast<std::size_t>(triangle[i])];
      const int from = triangle[(i + 1) % 3];
      const int to = triangle[(i + 2) % 3];
      const auto across = left_of.find({to, from});
      cell.neighbour[i] = across == left_of.end() ? -1 : across->second;
      if (cell.neighbour[i] < 0) border_.push_back({from, to});
    }
    cell.weights_from_direction = corners.inverse();
    cells_.push_back(cell);
  }
}

void SphericalInterpolator::find_border() {
  const auto at = [this](int i) -> const Direction& {
    return directions_[static_cast<std::size_t>(i)];
  };
  if (directions_.size() == 1) {
    border_.push_back({0, 0});
    return;
  }
  if (triangles_.empty()) {
    // All on one great circle: the arc from end to end. The first direction is turned to each other
    // one by less than half a turn, so the signed turn orders them.
    Direction axis = Direction::Zero();
    for (const Direction& d : directions_) {
      const Direction candidate = directions_.front().cross(d);
      if (candidate.squaredNorm() > axis.squaredNorm()) axis = candidate;
    }
    const auto turn = [&](int i) {
      return std::atan2(directions_.front().cross(at(i)).dot(axis.stableNormalized()),
                        directions_.front().dot(at(i)));
    };
    std::vector<std::pair<double, int>> order;
    for (std::size_t i = 0; i < directions_.size(); ++i)
      order.emplace_back(turn(static_cast<int>(i)), static_cast<int>(i));
    std::sort(order.begin(), order.end());
    for (std::size_t i = 1; i < order.size(); ++i)
      border_.push_back({order[i - 1].second, order[i].second});
    return;
  }
  const bool around_normal = std::all_of(border_.begin(), border_.end(), [&](const auto& edge) {
    return side_of_arc(at(edge[0]), at(edge[1]), Direction::UnitZ()) > 0.0;
  });
  if (!around_normal) return;
  const auto azimuth = [&](const std::array<int, 2>& edge) {
    return angles_from_direction(at(edge[0])).phi;
  };
  std::sort(border_.begin(), border_.end(), [&](const auto& a, const auto& b) {
    return azimuth(a) < azimuth(b);
  });
  for (const auto& edge : border_) border_azimuth_.push_back(azimuth(edge));
}

std::size_t SphericalInterpolator::hint_of(const Direction& direction) const {
  // Stereographic from straight below: the upper hemisphere fills the unit disc.
  const double scale = 0.5 * kHintCells / std::max(1.0 + direction.z(), 1e-3);
  const auto cell = [scale](double x) {
    return static_cast<int>(std::clamp(0.5 * kHintCells + scale * x, 0.0, kHintCells - 1.0));
  };
  return static_cast<std::size_t>(cell(direction.y()) * kHintCells + cell(direction.x()));
}

void SphericalInterpolator::fill_hints() {
  hints_.assign(static_cast<std::size_t>(kHintCells) * kHintCells, 0);
  int start = 0;
  for (int row = 0; row < kHintCells; ++row) {
    for (int column = 0; column < kHintCells; ++column) {
      const double x = (column + 0.5) / (0.5 * kHintCells) - 1.0;
      const double y = (row + 0.5) / (0.5 * kHintCells) - 1.0;
      const double r2 = x * x + y * y;
      const Direction centre(2.0 * x / (1.0 + r2), 2.0 * y / (1.0 + r2), (1.0 - r2) / (1.0 + r2));
      start = walk(centre, start).triangle;
      hints_[static_cast<std::size_t>(row * kHintCells + column)] = start;
    }
  }
}

SphericalInterpolator::Found SphericalInterpolator::walk(const Direction& direction,
                                                         int start) const {
  // Each step crosses the edge that the direction is furthest beyond. In a Delaunay triangulation
  // no triangle comes twice; the bound only guards against rounding.
  Found found{start, false, Eigen::Vector3d::Zero()};
  for (std::size_t step = 0; step <= triangles_.size(); ++step) {
    const Cell& cell = cells_[static_cast<std::size_t>(found.triangle)];
    found.weight = cell.weights_from_direction * direction;
    int worst = 0;
    if (found.weight.minCoeff(&worst) >= -kInsideTolerance) {
      found.inside = true;
      return found;
    }
    const int next = cell.neighbour[static_cast<std::size_t>(worst)];
    if (next >= 0) {
      found.triangle = next;
      continue;
    }
    // The border is convex: beyond any of its edges is outside.
    return found;
  }
  return found;
}

DirectionWeights SphericalInterpolator::weights(const Direction& direction) const {
  if (triangles_.empty()) return outside(direction);
  const Found found = walk(direction, hints_[hint_of(direction)]);
  if (!found.inside) return outside(direction);
  const Eigen::Vector3d positive = found.weight.cwiseMax(0.0);
  const double sum = positive.sum();
  return {triangles_[static_cast<std::size_t>(found.triangle)],
          {positive[0] / sum, positive[1] / sum, positive[2] / sum},
          1.0};
}

SphericalInterpolator::BorderPoint SphericalInterpolator::border_at_azimuth(
    const Direction& direction) const {
  const double phi = angles_from_direction(direction).phi;
  const auto above = std::upper_bound(border_azimuth_.begin(), border_azimuth_.end(), phi);
  // Before the first azimuth comes the edge that passes azimuth 0: the last one.
  const std::size_t edge = above == border_azimuth_.begin()
                               ? border_.size() - 1
                               : static_cast<std::size_t>(above - border_azimuth_.begin()) - 1;
  const auto [from, to] = border_[edge];
  // Only its direction counts; straight down, every azimuth is as good as 0.
  const bool straight_down = direction.head<2>().isZero(0.0);
  const Direction along = straight_down ? Direction::UnitX() : direction;
  const double w0 = std::max(cross2(along, directions_[static_cast<std::size_t>(to)]), 0.0);
  const double w1 = std::max(cross2(directions_[static_cast<std::size_t>(from)], along), 0.0);
  return {border_[edge], {w0 / (w0 + w1), w1 / (w0 + w1)}};
}

SphericalInterpolator::BorderPoint SphericalInterpolator::nearest_on_border(
    const Direction& direction) const {
  BorderPoint best{border_.front(), {1.0, 0.0}};
  double best_cosine = -2.0;
  for (const auto& edge : border_) {
    const Direction& a = directions_[static_cast<std::size_t>(edge[0])];
    const Direction& b = directions_[static_cast<std::size_t>(edge[1])];
    // The foot of the perpendicular to the arc is w0 a + w1 b with the normal equations' solution,
    // in a form that keeps its precision for short arcs.
    const double cosine = a.dot(b);
    const double sine2 = a.cross(b).squaredNorm();
    double w0 = 1.0;
    double w1 = 0.0;
    if (sine2 > 0.0) {
      const double da = direction.dot(a);
      const double db = direction.dot(b);
      w0 = (da - cosine * db) / sine2;
      w1 = (db - cosine * da) / sine2;
      if (w0 <= 0.0 || w1 <= 0.0) {
        // The foot is not on the arc: the nearer end.
        w0 = da >= db ? 1.0 : 0.0;
        w1 = 1.0 - w0;
      }
    }
    const Direction point = (w0 * a + w1 * b).normalized();
    if (point.dot(direction) > best_cosine) {
      best_cosine = point.dot(direction);
      best = {edge, {w0 / (w0 + w1), w1 / (w0 + w1)}};
    }
  }
  return best;
}

DirectionWeights SphericalInterpolator::outside(const Direction& direction) const {
  const BorderPoint border =
      border_azimuth_.empty() ? nearest_on_border(direction) : border_at_azimuth(direction);
  DirectionWeights result{{border.index[0], border.index[1], border.index[1]},
                          {border.weight[0], border.weight[1], 0.0},
                          1.0};
  if (role_ == DirectionRole::kView) return result;
  if (direction.z() <= 0.0) {
    result.scale = 0.0;
    return result;
  }
  const auto from = static_cast<std::size_t>(border.index[0]);
  const auto to = static_cast<std::size_t>(border.index[1]);
  const double theta = border.weight[0] * thetas_[from] + border.weight[1] * thetas_[to];
  const double cos_point =
      (border.weight[0] * directions_[from] + border.weight[1] * directions_[to]).normalized().z();
  const double cos_border = std::min(std::cos(theta), cos_point);
  // No division by the cosine of a border on the horizon: there every light is above the border.
  if (direction.z() < cos_border) result.scale = direction.z() / cos_border;
  return result;
}

}  // namespace veneer::btf
