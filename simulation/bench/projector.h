// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/colour.h"
#include "base/image.h"
#include "base/result.h"
#include "simulation/bench/spectrum.h"
#include "simulation/bench/truth.h"

namespace veneer::simulation {

/// The virtual projector: from codes to light. A drive gives *outputs*: parts of seven lights of
/// fixed spectra, of which the light of a pixel is the sum.
///
///   0 to 2  each channel's primary, relative to its own full drive while the others are off;
///   3 to 5  each channel's drift: what of its light has the chromaticity of the other two;
///   6       the clear segment, 0 where there is none.
class VirtualProjector {
 public:
  static constexpr int kOutputs = 7;
  using Outputs = Eigen::Matrix<double, kOutputs, 1>;
  using Light = Eigen::Matrix<float, kOutputs, 1>;  ///< outputs, one pixel of a blurred picture
  /// XYZ that a surface sends for output 1 of each light.
  using SurfaceOutputs = Eigen::Matrix<double, 3, kOutputs>;

  explicit VirtualProjector(const ProjectorTruth& truth);

  /// Where the ray to a point leaves the raster, in pixels; nothing for a point that is behind the
  /// lens or off the raster.
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel_of(const Eigen::Vector3d& x_in_world) const;
  /// cos of the angle between a pixel's ray and the axis.
  [[nodiscard]] double axis_cosine(const Eigen::Vector2d& pixel) const;
  /// Radiant intensity towards a pixel relative to the raster's centre.
  [[nodiscard]] double vignetting(const Eigen::Vector2d& pixel) const;

  /// Outputs of one code triple; every code is below 2^bits.
  [[nodiscard]] Outputs output(const Rgb16& code) const;
  /// Outputs of a linear drive in [0,1]^3 (tone curves undone).
  [[nodiscard]] Outputs interact(const Eigen::Vector3d& drive) const;
  /// The linear drive in [0,1]^3 for which `surface` sends `xyz` (above black); where none does,
  /// one from which no bounded Newton step leads closer. NaN for what is not finite.
  [[nodiscard]] Eigen::Vector3d drive_towards(const SurfaceOutputs& surface, const Xyz& xyz) const;
  /// Outputs of a frame after the lens has blurred it; no light comes from beyond the raster.
  /// Errors: kInvalidOption (a frame of another size, a code over 2^bits - 1).
  [[nodiscard]] Result<Image<Light>> project(ImageView<const Rgb16> codes) const;
  /// The same as three channels see it. @param channels  of output 1 of each light. Errors: as
  /// above.
  [[nodiscard]] Result<Image<Rgb32f>> project(
      ImageView<const Rgb16> codes, const Eigen::Matrix<float, 3, kOutputs>& channels) const;

  /// Spectral radiance of the perfect diffuser at the reference for output 1 of each light.
  [[nodiscard]] const std::array<Spectrum, kOutputs>& primaries() const { return primaries_; }
  [[nodiscard]] const Spectrum& black() const { return black_; }

 private:
  static constexpr int kSegment = 6;
  [[nodiscard]] Status check_frame(ImageView<const Rgb16> codes) const;
  [[nodiscard]] double raw_vignetting(const Eigen::Vector2d& pixel) const;
  /// interact(), the segment driven by `least` in place of the least drive.
  [[nodiscard]] Outputs outputs_with_segment(const Eigen::Vector3d& drive, double least) const;
  /// d outputs / d drive, the segment driven by channel `least`.
  [[nodiscard]] Eigen::Matrix<double, kOutputs, 3> slope(const Eigen::Vector3d& drive,
                                                         int least) const;
  /// Damped Newton from `drive`, kept within the cube; stops where no step leads closer.
  [[nodiscard]] Eigen::Vector3d newton(const SurfaceOutputs& surface,
                                       const Xyz& xyz,
                                       int least,
                                       Eigen::Vector3d drive) const;

  ProjectorTruth truth_;
  RigidTransform projector_from_world_;
  std::array<std::vector<double>, 3> tones_;  // linear drive of every code
  std::array<Spectrum, kOutputs> primaries_;
  Spectrum black_;
};

/// Convolves every light with a Gaussian integrated over the pixels' boxes; nothing lies beyond
/// the image. @param sigma  in pixels; 0 leaves the image as it is.
[[nodiscard]] Image<VirtualProjector::Light> blurred(const Image<VirtualProjector::Light>& image,
                                                     double sigma);
[[nodiscard]] Image<Rgb32f> blurred(const Image<Rgb32f>& image, double sigma);

}  // namespace veneer::simulation
