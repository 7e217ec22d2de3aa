// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <functional>
#include <optional>
#include <vector>

#include "simulation/materials/body_field.h"
#include "simulation/materials/geometry.h"

namespace veneer::simulation {

/// A field of bodies, made for rays. A ray goes from column to column of the tile; within one it
/// takes steps as long as the distance to the nearest body (sphere tracing, Hart 1996), and the
/// ground is met exactly.
class Solids final : public Geometry {
 public:
  /// @param field  valid (BodyField::check)
  explicit Solids(const BodyField& field);

  [[nodiscard]] int resolution() const override { return resolution_; }
  [[nodiscard]] double top() const override { return top_ * resolution_; }
  /// Gives up on a ray that runs level for more than 64 tiles.
  [[nodiscard]] std::optional<Hit> first_hit(const Eigen::Vector3d& from,
                                             const Eigen::Vector3d& direction) const override;
  [[nodiscard]] Eigen::Vector3d normal(const Hit& hit) const override;
  [[nodiscard]] Surface surface(const Hit& hit) const override;
  [[nodiscard]] Eigen::Vector3d lifted(const Hit& hit,
                                       const Eigen::Vector3d& normal) const override;

  /// How far a place is from the nearest matter of its column, tile widths; below 0 inside. Of any
  /// place of the periodic plane. Beyond the column's walls something may be nearer.
  [[nodiscard]] double distance(const Eigen::Vector3d& place) const;
  /// The surface straight above a place inside of matter: its normal, unit, grid frame.
  [[nodiscard]] Eigen::Vector3d normal_above(const Eigen::Vector3d& place) const;

 private:
  // A body as a column meets it: moved by whole tiles, so that places in the tile are right.
  struct Piece {
    Body body;
    int number;
  };
  struct Column {
    std::vector<Piece> pieces;
    double bottom = 0.0;
    double top = 0.0;
  };
  struct Nearest {
    double distance;
    const Piece* piece;  // null: the ground
  };

  void add(const Body& body, int number);
  [[nodiscard]] const Column& column(int x, int y) const;
  [[nodiscard]] static Nearest nearest(const Column& column, const Eigen::Vector3d& place);
  [[nodiscard]] Nearest nearest(const Eigen::Vector3d& place) const;
  [[nodiscard]] static std::optional<double> march(const Column& column,
                                                   const Eigen::Vector3d& from,
                                                   const Eigen::Vector3d& direction,
                                                   double length);
  [[nodiscard]] Hit hit_at(const Eigen::Vector3d& place) const;

  int resolution_;
  double top_;  // tile widths
  std::vector<Column> columns_;
  std::function<Surface(const Eigen::Vector3d& place, int body)> surface_at_;
};

}  // namespace veneer::simulation
