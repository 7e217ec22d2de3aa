// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "capture/plan.h"
#include "simulation/studio/truth.h"

namespace veneer::simulation::studio {

/// Where things are in a studio. Lengths in millimetres; poses too, as far as they stay in here.
/// The local frame stands in the middle of the sample's mean plane: x right on the board, y up, z
/// towards the camera.
class StudioGeometry {
 public:
  /// Rays a pixel.
  static constexpr int kRays = 16;
  struct Ray {
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;  ///< unit
  };

  /// @param truth  valid.
  /// Errors: kInvalidOption (an area or directions that make no sense: the text names them).
  [[nodiscard]] static Result<StudioGeometry> create(const StudioTruth& truth,
                                                     const capture::CapturePlan& plan);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const capture::SampleArea& area() const { return area_; }
  [[nodiscard]] const capture::CameraLens& lens() const { return lens_; }

  /// Of the camera that sees the sample from view number `view`, looking at its middle, the board's
  /// top up.
  [[nodiscard]] RigidTransform local_from_camera(int view) const;
  /// From the board's frame, z into the board.
  [[nodiscard]] RigidTransform local_from_board() const;
  /// Through a place of the picture; pixels, first centre (0.5, 0.5).
  [[nodiscard]] Ray ray(const RigidTransform& local_from_camera,
                        const Eigen::Vector2d& pixel) const;
  /// Where the camera sees a point before it.
  [[nodiscard]] Eigen::Vector2d pixel(const RigidTransform& local_from_camera,
                                      const Eigen::Vector3d& x_in_local) const;
  /// Places of a pixel's rays from its corner: a lattice in which no two rays share a column or a
  /// row, so that an edge along either is met as finely as the rays are many.
  [[nodiscard]] const std::array<Eigen::Vector2d, kRays>& ray_places() const { return places_; }

  /// Height of the plane of marks in the local frame.
  [[nodiscard]] double board_z() const { return -area_.lift_mm; }
  [[nodiscard]] Eigen::Vector2d board_place(const Eigen::Vector3d& x_in_local) const;
  /// The plan's texel at a point of the sample's plane, row by row.
  [[nodiscard]] std::optional<std::uint32_t> texel(const Eigen::Vector3d& x_in_local) const;
  /// Light over what there is in the board's middle.
  [[nodiscard]] double fall_off(const Eigen::Vector3d& x_in_local) const;
  /// Of the lens and sensor, at a place of the picture.
  [[nodiscard]] double vignetting(const Eigen::Vector2d& pixel) const;

 private:
  StudioGeometry(const StudioTruth& truth, const capture::CapturePlan& plan);
  int width_, height_;
  capture::SampleArea area_;
  capture::CameraLens lens_;
  std::vector<Eigen::Vector3d> views_;
  double distance_mm_;
  Eigen::Vector2d middle_;  // of the sample, on the board
  Eigen::Vector2d board_size_;
  double light_fall_off_, vignetting_;
  std::array<Eigen::Vector2d, kRays> places_;
};

/// Where a ray meets the plane at height z, on its way down.
[[nodiscard]] std::optional<Eigen::Vector3d> meet_plane(const StudioGeometry::Ray& ray, double z);

}  // namespace veneer::simulation::studio
