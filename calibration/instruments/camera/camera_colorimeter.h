// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <functional>
#include <span>
#include <string>

#include "base/colour.h"
#include "base/result.h"
#include "calibration/instruments/colorimeter.h"
#include "capture/camera.h"

namespace veneer::calibration {

/// What a camera saw of a patch whose colour a colorimeter has read.
struct CameraSample {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< as CameraColorimeter measures it
  Xyz xyz = Xyz::Zero();                           ///< cd/m^2
};

/// XYZ (cd/m^2) = xyz_from_rate * rate, and how well that holds.
struct CameraMatrix {
  Eigen::Matrix3d xyz_from_rate = Eigen::Matrix3d::Identity();
  /// dE00 of the samples against the matrix, with the brightest sample as white.
  double de00_mean = 0;
  double de00_max = 0;
};

/// Least squares, each sample weighted by the inverse of its Y, so that dark ones count as much.
/// Errors: kBadFormat (fewer than four samples, none that is bright, not finite, samples whose
/// colours lie in one plane: show red, green, blue and white at least).
[[nodiscard]] Result<CameraMatrix> fit_camera_matrix(std::span<const CameraSample> samples);

struct CameraColorimeterOptions {
  Eigen::Matrix3d xyz_from_rate = Eigen::Matrix3d::Identity();
  /// Counts without light, as a part of full scale; 0 to 0.5.
  double black_level = 0;
  int spot_radius = 8;  ///< camera pixels; 0 to 1000
  int frames = 4;       ///< that are averaged; 1 to 1000
  [[nodiscard]] Status check() const;
};

/// A camera used as a colorimeter. `rate` is (counts / full scale - black level) / exposure in 1/s,
/// the mean over a round spot.
///
/// Its limits: filters of a camera are no colour-matching functions, so that the matrix holds for
/// the spectra it was fitted on and no others, that is for this projector on this surface; what it
/// reads of another surface is wrong by as much as the surfaces' spectra differ (metamerism). It
/// does not know the camera's vignetting, and reads what the exposure allows: under a hundredth of
/// full scale noise and a wrong black level dominate.
class CameraColorimeter final : public Colorimeter {
 public:
  /// Where in the camera's picture (camera pixels) the spot is that a projector pixel lights.
  using CameraFromProjector =
      std::function<Eigen::Vector2d(Target target, const Eigen::Vector2d& projector_pixel)>;

  /// @param camera  borrowed; must outlive this.   @param options  pass check() (checked).
  CameraColorimeter(capture::Camera& camera,
                    CameraColorimeterOptions options,
                    CameraFromProjector camera_from_projector);

  [[nodiscard]] std::string description() const override;
  /// Errors: kBadFormat (saturated: says what to do), kNotFound (the spot is outside of the
  /// picture), those of the camera.
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;
  /// The same before the matrix, for fit_camera_matrix().
  [[nodiscard]] Result<Eigen::Vector3d> read_rate(Target target, const Eigen::Vector2d& pixel);

 private:
  capture::Camera& camera_;
  CameraColorimeterOptions options_;
  CameraFromProjector camera_from_projector_;
};

}  // namespace veneer::calibration
