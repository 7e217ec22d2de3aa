// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "capture/cameras/camera.h"
#include "simulation/bench.h"
#include "simulation/bench/board_view.h"
#include "simulation/bench/colorimeter.h"

namespace veneer::simulation {

/// The bench's camera: it sees the board, lit by what the display shows and by the ambient light;
/// around the board is black. Counts are cut at 0 and at full scale; there is no offset. The same
/// pictures for the same seed. A grab passes 0.1 s of the bench's time, or the exposure where that
/// is longer.
class VirtualCamera final : public capture::Camera {
 public:
  /// @param bench, display  borrowed; must outlive the camera.
  /// Errors: kInvalidOption (a bench without camera and board; no room for the board).
  [[nodiscard]] static Result<std::unique_ptr<VirtualCamera>> create(const Bench& bench,
                                                                     VirtualPatchDisplay& display);

  [[nodiscard]] std::string description() const override { return "the bench's camera"; }
  [[nodiscard]] int width() const override { return truth_.width; }
  [[nodiscard]] int height() const override { return truth_.height; }
  [[nodiscard]] Status set_exposure(double seconds) override;
  [[nodiscard]] Result<capture::CameraFrame> grab() override;

  /// world_from_board of every place for the board.
  [[nodiscard]] const std::vector<RigidTransform>& board_poses() const& { return poses_; }
  const std::vector<RigidTransform>& board_poses() const&& = delete;
  /// Errors: kInvalidOption (no such pose).
  [[nodiscard]] Status place_board(int pose);
  void remove_board();

 private:
  static constexpr double kFirstExposure_s = 0.005;
  VirtualCamera(const Bench& bench,
                VirtualPatchDisplay& display,
                std::vector<RigidTransform> poses);
  [[nodiscard]] Status light_raster();

  const Bench& bench_;
  VirtualPatchDisplay& display_;
  CameraTruth truth_;
  BoardTruth board_;
  VirtualProjector projector_;
  std::vector<RigidTransform> poses_;
  std::optional<BoardView> view_;
  Eigen::Matrix<float, 3, VirtualProjector::kOutputs> seen_outputs_;  // by the camera's channels
  Rgb32f seen_black_;
  Rgb32f seen_ambient_;
  std::uint64_t lit_picture_ = 0;  // the display's picture that raster_ is of
  Image<Rgb32f> raster_;           // as the camera's channels see it, lamp settled
  double exposure_s_;
  std::uint64_t grabs_ = 0;
  std::vector<float> deviates_;  // a table of normal ones
};

}  // namespace veneer::simulation
