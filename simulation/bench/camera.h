// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "capture/camera.h"
#include "simulation/bench.h"
#include "simulation/bench/board_view.h"
#include "simulation/bench/colorimeter.h"
#include "simulation/bench/object_view.h"
#include "simulation/bench/projector.h"
#include "simulation/bench/spectrum.h"

namespace veneer::simulation {

/// The bench's camera: it sees the board or the object, lit by what the display shows and by the
/// ambient light; around it is black. Counts are cut at 0 and at full scale; there is no offset.
/// The same pictures for the same seed. A grab passes 0.1 s of the bench's time, or the exposure
/// where that is longer.
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
  [[nodiscard]] capture::ExposureRange exposure_range() const override {
    return {truth_.least_exposure_s, truth_.most_exposure_s};
  }
  [[nodiscard]] Result<capture::CameraFrame> grab() override;

  /// world_from_board of every place for the board.
  [[nodiscard]] const std::vector<RigidTransform>& board_poses() const& { return poses_; }
  const std::vector<RigidTransform>& board_poses() const&& = delete;
  /// Errors: kInvalidOption (no such pose).
  [[nodiscard]] Status place_board(int pose);
  /// The board anywhere, as a hand may hold it; seen where the camera's picture reaches.
  /// @param world_from_board  finite; the board in front of the camera.
  void place_board(const RigidTransform& world_from_board);
  void remove_board();
  /// The object, which is seen while no board is in the way; none stands there at first.
  void place_object(const RigidTransform& world_from_object);

 private:
  static constexpr double kFirstExposure_s = 0.005;
  VirtualCamera(const Bench& bench,
                VirtualPatchDisplay& display,
                std::vector<RigidTransform> poses);

  const Bench& bench_;
  VirtualPatchDisplay& display_;
  CameraTruth truth_;
  BoardTruth board_;
  VirtualProjector projector_;
  std::vector<RigidTransform> poses_;
  std::optional<BoardView> view_;
  std::optional<ObjectView> object_;
  /// Of one surface, as the camera's channels see it.
  struct SeenLight {
    Eigen::Matrix<float, 3, VirtualProjector::kOutputs> outputs;
    Rgb32f black;
    Rgb32f ambient;
    std::uint64_t lit_picture = 0;  // the display's picture that raster is of
    Image<Rgb32f> raster;           // lamp settled
  };
  [[nodiscard]] Status light_raster(SeenLight& light) const;
  [[nodiscard]] SeenLight seen_on(const Spectrum& reflectance) const;
  SeenLight on_white_;
  ObjectView::OnObject<SeenLight> on_object_;
  double exposure_s_;
  std::uint64_t grabs_ = 0;
  std::vector<float> deviates_;  // a table of normal ones
};

}  // namespace veneer::simulation
