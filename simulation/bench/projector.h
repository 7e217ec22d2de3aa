// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "simulation/bench/spectrum.h"
#include "simulation/bench/truth.h"

namespace veneer::simulation {

/// The virtual projector: from codes to light. A channel's *output* is its light relative to its
/// own full drive while the others are off.
class VirtualProjector {
 public:
  explicit VirtualProjector(const ProjectorTruth& truth);

  /// Where the ray to a point leaves the raster, in pixels; nothing for a point that is behind the
  /// lens or off the raster.
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel_of(const Eigen::Vector3d& x_in_world) const;
  /// cos of the angle between a pixel's ray and the axis.
  [[nodiscard]] double axis_cosine(const Eigen::Vector2d& pixel) const;
  /// Radiant intensity towards a pixel relative to the raster's centre.
  [[nodiscard]] double vignetting(const Eigen::Vector2d& pixel) const;

  /// Outputs of one code triple; every code is below 2^bits.
  [[nodiscard]] Eigen::Vector3d output(const Rgb16& code) const;
  /// Outputs of a linear drive in [0,1]^3 (tone curves undone).
  [[nodiscard]] Eigen::Vector3d interact(const Eigen::Vector3d& drive) const;
  /// The linear drive in [0,1]^3 that gives `output`; where none does, one with channels cut to
  /// [0,1]. NaN for NaN.
  [[nodiscard]] Eigen::Vector3d drive_towards(const Eigen::Vector3d& output) const;
  /// Outputs of a frame after the lens has blurred it; no light comes from beyond the raster.
  /// Errors: kInvalidOption (a frame of another size, a code over 2^bits - 1).
  [[nodiscard]] Result<Image<Rgb32f>> project(ImageView<const Rgb16> codes) const;

  /// Spectral radiance of the perfect diffuser at the reference for output 1 of each channel.
  [[nodiscard]] const std::array<Spectrum, 3>& primaries() const { return primaries_; }
  [[nodiscard]] const Spectrum& black() const { return black_; }

 private:
  [[nodiscard]] double raw_vignetting(const Eigen::Vector2d& pixel) const;

  ProjectorTruth truth_;
  RigidTransform projector_from_world_;
  std::array<std::vector<double>, 3> tones_;  // linear drive of every code
  std::array<Spectrum, 3> primaries_;
  Spectrum black_;
};

/// Convolves every channel with a Gaussian integrated over the pixels' boxes; nothing lies beyond
/// the image. @param sigma  in pixels; 0 leaves the image as it is.
[[nodiscard]] Image<Rgb32f> blurred(const Image<Rgb32f>& image, double sigma);

}  // namespace veneer::simulation
