// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// What one camera pixel saw of a matte board that the projector lit all over with one code.
/// Counts are linear, all of one channel.
struct FallOffSample {
  Eigen::Vector2d projector = Eigen::Vector2d::Zero();  ///< pixel, first centre (0.5, 0.5)
  Eigen::Vector2d camera = Eigen::Vector2d::Zero();     ///< likewise
  double lit = 0;    ///< counts under the code, as the camera gave them
  double unlit = 0;  ///< under black; same exposure
  Eigen::Vector3d x_in_projector = Eigen::Vector3d::Zero();       ///< of the board, metres
  Eigen::Vector3d normal_in_projector = Eigen::Vector3d::Zero();  ///< to either side; any length
  int pose = 0;                                                   ///< of the board; from 0
};

/// A camera's own fall-off, of lens and sensor: exp of a polynomial in the squared distance
/// from a centre, 1 there.
struct CameraFallOff {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< pixels
  double half_diagonal_px = 1;                       ///< above 0: of the picture
  /// Of rho^2, rho^4, rho^6 in the logarithm, rho in half diagonals.
  std::array<double, 3> coefficients{};

  /// Light that the camera keeps at a pixel, relative to the centre. Above 0.
  [[nodiscard]] double operator()(const Eigen::Vector2d& pixel) const;
};

struct FallOffOptions {
  int camera_width = 0;  ///< pixels; above 0, like the next
  int camera_height = 0;
  /// The centre of the camera's own fall-off, pixels; not finite: the middle of the picture.
  Eigen::Vector2d camera_centre{std::nan(""), std::nan("")};
  /// Whether the camera's own fall-off is fitted. Without it the camera's counts must have been
  /// corrected for it: one pose of the board is then enough.
  bool fit_camera = true;
  /// Counts at or above this are saturated; 0: none are.
  double full_scale = 65535;
  /// A sample is too dark below this part of its pose's 95th percentile. 0 to 0.9.
  double least_light = 0.05;
  /// Below this cosine of the angle of incidence no board is matte enough. 0.05 to 0.95.
  double least_cosine = 0.3;
  /// Most of FallOff::inflation; beyond it there is no result. Boards held all over the raster,
  /// near and far, reach 1.1 to 1.3; one that stays within millimetres reaches 20. Above 1.
  double most_inflation = 10;
  /// More samples than this are thinned evenly. 1000 or more.
  int most_samples = 50000;

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

/// The fall-off of the projector and how far it is to be trusted.
struct FallOff {
  /// As ProjectorProfile::vignetting: the radiant intensity over the raster, 1 at its centre.
  Image<float> vignetting;
  /// Of `vignetting`'s size: 1 where samples lie, 0 where the value is extrapolated.
  Image<std::uint8_t> covered;
  double coverage = 0;           ///< part of the texels that are covered
  double most_extrapolated = 0;  ///< largest distance of a texel from a covered one, half diagonals
  CameraFallOff camera;          ///< 1 everywhere where it is not fitted
  int order = 0;                 ///< total degree of the projector's polynomial
  int camera_terms = 0;          ///< of CameraFallOff that are in use
  /// One a pose: its counts relative to those of the first, at equal light: exposure, lamp.
  std::vector<double> gains;
  /// Relative deviation of counts from the model, root mean square of what is no outlier.
  double residual_rms = 0;
  /// The same for samples of a pose that the fit did not see, but for its gain, where other poses
  /// reach the raster too. With fewer than 4 poses, parts of the raster are left out instead.
  double held_out_rms = 0;
  /// How many times larger errors of the samples could become in `vignetting` since the camera's
  /// fall-off has to be told from the projector's, were that of the highest order. 1: not at all.
  double inflation = 1;

  // Samples by what became of them.
  std::int64_t used = 0;      ///< before thinning
  std::int64_t fitted = 0;    ///< after it
  std::int64_t outliers = 0;  ///< of those fitted: without weight, such as glossy spots
  std::int64_t saturated = 0;
  std::int64_t dark = 0;
  std::int64_t grazing = 0;
  std::int64_t not_finite = 0;        ///< a value that is no number, or a pixel off the raster
  std::vector<std::string> warnings;  ///< for people; empty when all is well
};

/// The projector's fall-off (vignetting) from pictures of a white matte board in several poses.
///
/// In logarithms and least squares, with one gain g a pose,
///   log counts = g(pose) + log(cos(theta_p) / r^2) + P(projector pixel) + C(camera pixel).
/// P is a polynomial over the raster, zero at its centre, of total degree 2, 4, 6 or 8; C has 1 to
/// 3 terms of CameraFallOff, or none. Which are taken is decided by what predicts poses best that
/// were left out. Samples count by their light (the noise of a photon count) and, so that glossy
/// spots and stray light do no harm, by Tukey's biweight of their deviation. The board has to move
/// over the camera's picture relative to the raster (near and far, tilted), or else the two
/// fall-offs cannot be told apart. Where no sample lies, the value is extrapolated: P over a short
/// way, and from there on as the parabola that fits best goes. Deterministic; one thread.
/// Source: the biweight is Beaton and Tukey's, with the constant of Holland and Welsch 1977,
/// "Robust Regression Using Iteratively Reweighted Least-Squares".
///
/// Errors: kInvalidOption (options, the raster); kBadFormat (too few usable samples; the poses
/// cannot separate the two fall-offs; the text says why and what to do).
[[nodiscard]] Result<FallOff> measure_fall_off(std::span<const FallOffSample> samples,
                                               const ProjectorGeometry& geometry,
                                               const FallOffOptions& options);

}  // namespace veneer::calibration
