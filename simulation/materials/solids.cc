// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/solids.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace veneer::simulation {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kColumns = 16;  // along each side of the tile
// A ray that runs level never comes down; by then it has met everything there is.
constexpr int kMaxTiles = 64;
// In tile widths, all far under a texel of the largest set (1/512). A ray that is so near has met
// its body; no step is shorter than the next; a secondary ray starts so far off.
constexpr double kTouch = 1e-6;
constexpr double kLeastStep = 5e-6;
constexpr double kLift = 1e-5;

double wrapped(double place) {
  return std::min(place - std::floor(place), std::nextafter(1.0, 0.0));
}

Eigen::Vector3d in_tile(const Eigen::Vector3d& place) {
  return {wrapped(place.x()), wrapped(place.y()), place.z()};
}

// From a place in [0, 1] of a column to the wall ahead, in columns.
double wall_distance(double at, double slope) {
  if (slope > 0.0) return (1.0 - at) / slope;
  if (slope < 0.0) return -at / slope;
  return kNever;
}

}  // namespace

Solids::Solids(const BodyField& field)
    : resolution_(field.resolution),
      top_(kLift),
      columns_(static_cast<std::size_t>(kColumns) * kColumns),
      surface_at_(field.surface_at) {
  for (std::size_t i = 0; i < field.bodies.size(); ++i) add(field.bodies[i], static_cast<int>(i));
}

void Solids::add(const Body& body, int number) {
  // The columns of the endless plane that it reaches into. Of a bar without ends, those of one
  // tile: all its parts are alike.
  std::array<int, 2> first{};
  std::array<int, 2> last{};
  const auto [low, high] = body.bounds();
  for (int axis = 0; axis < 2; ++axis) {
    const auto at = static_cast<std::size_t>(axis);
    const bool endless = std::isinf(low[axis]);
    // A touch more, for what rounding leaves on the wrong side of a wall.
    first[at] = endless ? 0 : static_cast<int>(std::floor((low[axis] - kLift) * kColumns));
    last[at] =
        endless ? kColumns - 1 : static_cast<int>(std::floor((high[axis] + kLift) * kColumns));
  }
  const double bottom = low.z();
  const double top = high.z();
  top_ = std::max(top_, top + kLift);
  for (int y = first[1]; y <= last[1]; ++y) {
    for (int x = first[0]; x <= last[0]; ++x) {
      const Eigen::Vector3d tile(
          std::floor(double(x) / kColumns), std::floor(double(y) / kColumns), 0.0);
      Piece piece{body, number};
      piece.body.first -= tile;
      piece.body.second -= tile;
      const int column_x = x - static_cast<int>(tile.x()) * kColumns;
      const int column_y = y - static_cast<int>(tile.y()) * kColumns;
      Column& column = columns_[static_cast<std::size_t>(column_y * kColumns + column_x)];
      column.bottom = column.pieces.empty() ? bottom : std::min(column.bottom, bottom);
      column.top = column.pieces.empty() ? top : std::max(column.top, top);
      column.pieces.push_back(piece);
    }
  }
}

const Solids::Column& Solids::column(int x, int y) const {
  return columns_[static_cast<std::size_t>(y * kColumns + x)];
}

Solids::Nearest Solids::nearest(const Column& column, const Eigen::Vector3d& place) {
  Nearest result{kNever, nullptr};
  for (const Piece& piece : column.pieces) {
    const double distance = piece.body.distance(place);
    if (distance < result.distance) result = {distance, &piece};
  }
  return result;
}

Solids::Nearest Solids::nearest(const Eigen::Vector3d& place) const {
  Nearest result = nearest(
      column(static_cast<int>(place.x() * kColumns), static_cast<int>(place.y() * kColumns)),
      place);
  if (place.z() <= result.distance) result = {place.z(), nullptr};
  return result;
}

double Solids::distance(const Eigen::Vector3d& place) const {
  return nearest(in_tile(place)).distance;
}

std::optional<double> Solids::march(const Column& column,
                                    const Eigen::Vector3d& from,
                                    const Eigen::Vector3d& direction,
                                    double length) {
  if (column.pieces.empty()) return std::nullopt;
  const double to_z = from.z() + length * direction.z();
  if (std::min(from.z(), to_z) > column.top || std::max(from.z(), to_z) < column.bottom)
    return std::nullopt;
  for (double gone = 0.0; gone <= length;) {
    const double distance = nearest(column, from + gone * direction).distance;
    if (distance < kTouch) return gone;
    gone += std::max(distance, kLeastStep);
  }
  return std::nullopt;
}

std::optional<Geometry::Hit> Solids::first_hit(const Eigen::Vector3d& from,
                                               const Eigen::Vector3d& direction) const {
  const double dz = direction.z();
  Eigen::Vector3d start = from / resolution_;
  if (start.z() > top_) {
    if (dz >= 0.0) return std::nullopt;
    start += direction * ((top_ - start.z()) / dz);
  }
  if (start.z() <= 0.0) return hit_at(start);
  double left = kMaxTiles;  // to go
  if (dz < 0.0) left = start.z() / -dz;
  if (dz > 0.0) left = std::min(left, (top_ - start.z()) / dz);

  // From column to column; places are kept relative to the column, so that nothing adds up.
  start = in_tile(start);
  auto x = static_cast<int>(start.x() * kColumns);
  auto y = static_cast<int>(start.y() * kColumns);
  double u = start.x() * kColumns - x;
  double v = start.y() * kColumns - y;
  double z = start.z();
  for (;;) {
    const double to_x = wall_distance(u, direction.x());
    const double to_y = wall_distance(v, direction.y());
    const double to_wall = std::min(to_x, to_y) / kColumns;
    const double leg = std::min(to_wall, left);
    const Eigen::Vector3d place((x + u) / kColumns, (y + v) / kColumns, z);
    if (const auto gone = march(column(x, y), place, direction, leg))
      return hit_at(place + *gone * direction);
    if (left <= to_wall) {
      if (dz >= 0.0) return std::nullopt;
      Eigen::Vector3d ground = place + leg * direction;
      ground.z() = 0.0;
      return hit_at(ground);
    }
    left -= leg;
    z += leg * dz;
    const double columns = leg * kColumns;
    if (to_x <= to_y) {
      v = std::clamp(v + columns * direction.y(), 0.0, 1.0);
      u = direction.x() > 0.0 ? 0.0 : 1.0;
      x = (x + (direction.x() > 0.0 ? 1 : kColumns - 1)) % kColumns;
    } else {
      u = std::clamp(u + columns * direction.x(), 0.0, 1.0);
      v = direction.y() > 0.0 ? 0.0 : 1.0;
      y = (y + (direction.y() > 0.0 ? 1 : kColumns - 1)) % kColumns;
    }
  }
}

Geometry::Hit Solids::hit_at(const Eigen::Vector3d& place) const {
  const Eigen::Vector3d cells = in_tile(place) * resolution_;
  const int column = std::min(static_cast<int>(cells.x()), resolution_ - 1);
  const int row = std::min(static_cast<int>(cells.y()), resolution_ - 1);
  return {column, row, cells.x() - column, cells.y() - row, cells.z()};
}

Eigen::Vector3d Solids::normal(const Hit& hit) const {
  const Eigen::Vector3d place = in_tile(position(hit) / resolution_);
  const Nearest met = nearest(place);
  if (met.piece == nullptr) return Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d away = place - met.piece->body.nearest(place);
  // On the core itself, which only a ray that starts inside meets, any will do.
  return away.norm() > 0.0 ? Eigen::Vector3d(away.normalized()) : Eigen::Vector3d::UnitZ();
}

Surface Solids::surface(const Hit& hit) const {
  const Eigen::Vector3d place = in_tile(position(hit) / resolution_);
  const Nearest met = nearest(place);
  return surface_at_(place, met.piece == nullptr ? BodyField::kGround : met.piece->number);
}

Eigen::Vector3d Solids::lifted(const Hit& hit, const Eigen::Vector3d& normal) const {
  // A ray stops a touch before a body, or up to a least step behind its surface.
  const Eigen::Vector3d place = in_tile(position(hit) / resolution_);
  return position(hit) + (kLift - nearest(place).distance) * resolution_ * normal;
}

Eigen::Vector3d Solids::normal_above(const Eigen::Vector3d& place) const {
  Eigen::Vector3d at = in_tile(place);
  for (double inside = -nearest(at).distance; inside > 0.0; inside = -nearest(at).distance)
    at.z() += std::max(inside, kLeastStep);
  return normal(hit_at(at));
}

}  // namespace veneer::simulation
