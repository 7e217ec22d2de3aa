// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "simulation/bench/projector.h"
#include "simulation/bench/truth.h"

namespace veneer::simulation {

/// Radii of the distorted picture back to slopes, tabulated; exact to 1e-9 of a radius.
class RadialDistortion {
 public:
  /// @param k1, k2, most_slope  as of CameraTruth; rising up to `most_slope` (CameraTruth::check
  ///                            sees to it).
  RadialDistortion(double k1, double k2, double most_slope);
  /// (x / z, y / z) to the same with distortion.
  [[nodiscard]] Eigen::Vector2d distorted(const Eigen::Vector2d& slope) const;
  /// Its inverse, up to the distorted `most_slope`; beyond it the last factor.
  [[nodiscard]] Eigen::Vector2d undistorted(const Eigen::Vector2d& slope) const;

 private:
  double k1_;
  double k2_;
  double most_squared_;          // of a distorted slope
  std::vector<double> factors_;  // slope / distorted slope, at equal steps of the latter's square
};

/// Of a camera's lens, wide enough for its picture.
[[nodiscard]] RadialDistortion distortion_of(const CameraTruth& camera);

/// Where the rays of a pixel go through, from its corner: a pixel and a lens that blurs by a
/// pixel's width make a tent. A lattice in which no two rays share a column or a row, so that an
/// edge along either is met as finely as the rays are many.
[[nodiscard]] std::vector<Eigen::Vector2d> ray_places(int rays);

/// Where the board's inner corner (column, row) stands in the board's frame; (-1, -1) is the outer
/// corner of the squares, whose square is black.
[[nodiscard]] Eigen::Vector3d board_corner(const BoardTruth& board, int column, int row);

/// The reflectance of a point of the board's plane; 0 off the board.
/// @param width  of the box, along x and y in metres, over which the chequers are averaged; 0 for
///               none.
[[nodiscard]] double board_reflectance(const BoardTruth& board,
                                       const Eigen::Vector2d& point,
                                       const Eigen::Vector2d& width = {0, 0});

/// Where a camera sees a point, with distortion, pixels; anywhere, on its picture or not.
/// @param x_in_world  in front of the camera.
[[nodiscard]] Eigen::Vector2d camera_pixel(const CameraTruth& camera,
                                           const Eigen::Vector3d& x_in_world);

/// The poses at which the board is held, world_from_board, as BoardTruth says.
/// Errors: kInvalidOption (no room in what projector and camera see; says what to change).
[[nodiscard]] Result<std::vector<RigidTransform>> board_poses(const BoardTruth& board,
                                                              const CameraTruth& camera,
                                                              const ProjectorTruth& projector);

/// What each pixel of a camera sees of a board in one pose: for every ray the raster pixel that
/// lights its end, and how strongly. Made once a pose, so that a picture is a gather.
class BoardView {
 public:
  BoardView(const BoardTruth& board,
            const CameraTruth& camera,
            const VirtualProjector& projector,
            const ProjectorTruth& projector_truth,
            const RigidTransform& world_from_board);

  /// Mean light of every pixel, row by row.
  /// @param raster  light of every raster pixel on a perfect diffuser at G = 1, black included, in
  ///                any unit, as the camera's three channels see it.
  /// @param lamp  part of that light.   @param ambient  the same of the ambient light.
  [[nodiscard]] Image<Rgb32f> gather(const Image<Rgb32f>& raster,
                                     float lamp,
                                     const Rgb32f& ambient) const;

 private:
  struct Sample {
    std::uint32_t raster_pixel;
    float weight;  // reflectance * G / rays of a pixel
  };
  int width_;
  int height_;
  std::vector<std::uint32_t> first_;  // samples of pixel i: [first[i], first[i + 1])
  std::vector<Sample> samples_;
  std::vector<float> reflectance_;  // mean of the pixel's rays
};

}  // namespace veneer::simulation
