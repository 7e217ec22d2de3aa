// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/body_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace veneer::simulation {

namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr double kFurthest = 4.0;  // tile widths, of all that is not endless

// Both ends of one axis: finite and in reach, or without any end.
bool is_axis(double low, double high, bool may_be_endless) {
  if (may_be_endless && low == -kEndless && high == kEndless) return true;
  return std::abs(low) <= kFurthest && std::abs(high) <= kFurthest;
}

bool is_body(const Body& body) {
  const bool box = body.core == Body::Core::kBox;
  for (int axis = 0; axis < 3; ++axis) {
    if (!is_axis(body.first[axis], body.second[axis], box && axis < 2)) return false;
    if (box && body.first[axis] > body.second[axis]) return false;
  }
  return body.radius > 0.0 && body.radius <= kFurthest;
}

}  // namespace

Eigen::Vector3d Body::nearest(const Eigen::Vector3d& place) const {
  if (core == Core::kBox) return place.cwiseMax(first).cwiseMin(second);
  const Eigen::Vector3d along = second - first;
  const double square = along.squaredNorm();
  if (square == 0.0) return first;
  if (core == Core::kDisc) {
    const Eigen::Vector3d off = place - first;
    const Eigen::Vector3d across = off - off.dot(along) / square * along;
    const double outside = across.squaredNorm() / square;
    return first + (outside > 1.0 ? Eigen::Vector3d(across / std::sqrt(outside)) : across);
  }
  return first + std::clamp((place - first).dot(along) / square, 0.0, 1.0) * along;
}

std::array<Eigen::Vector3d, 2> Body::bounds() const {
  Eigen::Vector3d low = first.cwiseMin(second);
  Eigen::Vector3d high = first.cwiseMax(second);
  if (core == Core::kDisc) {
    // Along each axis the disc reaches as far as its own axis leaves it.
    const Eigen::Vector3d along = second - first;
    const Eigen::Vector3d reach =
        (along.squaredNorm() - along.array().square()).cwiseMax(0.0).sqrt().matrix();
    low = first - reach;
    high = first + reach;
  }
  return {low.array() - radius, high.array() + radius};
}

Body sphere(const Eigen::Vector3d& middle, double radius) {
  return {Body::Core::kLine, middle, middle, radius};
}

Body capsule(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius) {
  return {Body::Core::kLine, from, to, radius};
}

Body disc(const Eigen::Vector3d& middle, const Eigen::Vector3d& axis, double half_thickness) {
  return {Body::Core::kDisc, middle, middle + axis, half_thickness};
}

Body endless_bar(bool along_x,
                 double across,
                 double height,
                 double half_width,
                 double half_thickness,
                 double radius) {
  const double side = half_width - radius;
  const double up = half_thickness - radius;
  Body bar{Body::Core::kBox,
           {-kEndless, across - side, height - up},
           {kEndless, across + side, height + up},
           radius};
  if (!along_x) {
    std::swap(bar.first.x(), bar.first.y());
    std::swap(bar.second.x(), bar.second.y());
  }
  return bar;
}

Status BodyField::check() const {
  if (resolution < 1)
    return fail(Errc::kInvalidOption, "checking bodies: resolution {} is not positive", resolution);
  if (!(tile_width_mm > 0.0) || !std::isfinite(tile_width_mm))
    return fail(Errc::kInvalidOption,
                "checking bodies: tile width {} mm is not a positive number",
                tile_width_mm);
  if (!surface_at)
    return fail(Errc::kInvalidOption, "checking bodies: nothing says what they are made of");
  const auto bad = std::ranges::find_if_not(bodies, &is_body);
  if (bad != bodies.end())
    return fail(Errc::kInvalidOption,
                "checking bodies: number {} has no radius, is inside out, or reaches further than "
                "{} tile widths",
                bad - bodies.begin(),
                kFurthest);
  return {};
}

}  // namespace veneer::simulation
