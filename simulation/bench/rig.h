// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <memory>
#include <string>
#include <vector>

#include "base/mesh.h"
#include "base/random.h"
#include "simulation/bench/camera.h"
#include "simulation/bench/colorimeter.h"
#include "tracking/synchronised.h"

namespace veneer::simulation {

/// A place of the object that a person can find and touch.
struct Landmark {
  std::string name;  ///< "topmost point"
  Eigen::Vector3d in_object = Eigen::Vector3d::Zero();
};

/// Points of a mesh that stand out in some direction, at least six on anything solid; no two of
/// them are the same point.
[[nodiscard]] std::vector<Landmark> landmarks_of(const Mesh& mesh);

/// All devices of a virtual bench, and what a person does with them. The object stands at the
/// world's origin, unturned; the tracker's world is the bench's. The same for the same seeds. One
/// thread.
class VirtualRig {
 public:
  /// @param bench  borrowed; must outlive the rig.
  /// Errors: kInvalidOption (a bench without camera and board, no room for the board).
  [[nodiscard]] static Result<std::unique_ptr<VirtualRig>> create(const Bench& bench);

  [[nodiscard]] VirtualPatchDisplay& display() { return display_; }
  [[nodiscard]] VirtualColorimeter& colorimeter() { return colorimeter_; }
  [[nodiscard]] VirtualCamera& camera() { return *camera_; }
  /// What a person knows of the board.
  [[nodiscard]] int board_columns() const;  ///< of inner corners
  [[nodiscard]] int board_rows() const;
  [[nodiscard]] double board_square_m() const;

  [[nodiscard]] int board_poses() const;
  /// Errors: kInvalidOption (no such pose).
  [[nodiscard]] Status place_board(int pose);
  void remove_board();
  /// The tracked sensor that is fixed to the board, world_from_sensor, with the tracker's noise.
  /// Errors: kInvalidOption (no board stands there).
  [[nodiscard]] Result<tracking::SynchronisedPose> board_sensor();

  [[nodiscard]] const std::vector<Landmark>& landmarks() const& { return landmarks_; }
  const std::vector<Landmark>& landmarks() const&& = delete;
  /// Where the tracked stylus says that a point of the object is, in the world.
  [[nodiscard]] Eigen::Vector3d touch(const Eigen::Vector3d& x_in_object);
  /// The same of the spot that a raster position lights on the object.
  /// Errors: kInvalidOption (it does not fall on the object).
  [[nodiscard]] Result<Eigen::Vector3d> touch_spot(const Eigen::Vector2d& pixel);
  /// Standard deviation of a touched point along each axis.
  [[nodiscard]] double touch_deviation_m() const;

  /// Lets the bench's time pass.
  void warm_up(double seconds) { display_.pass(seconds); }

 private:
  explicit VirtualRig(const Bench& bench);
  [[nodiscard]] Eigen::Vector3d noise(double deviation);

  const Bench& bench_;
  VirtualPatchDisplay display_;
  VirtualColorimeter colorimeter_;
  std::unique_ptr<VirtualCamera> camera_;
  std::vector<Landmark> landmarks_;
  int pose_ = -1;  // none
  Pcg32 random_;   // of the tracker
};

}  // namespace veneer::simulation
