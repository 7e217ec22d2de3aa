// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/direction.h"
#include "capture/development/hdr_merge.h"
#include "capture/development/rectification.h"
#include "capture/development/response.h"
#include "capture/polarisation/separation.h"
#include "capture/recording.h"

namespace veneer::capture {

struct DevelopmentOptions {
  /// From counts to light; where `recover` names a method it is found from the white target's
  /// brackets instead.
  ResponseCurve response;
  std::optional<ResponseMethod> recover;
  /// The mirror's contrast corrects for extinction and misalignment; without it (or without a
  /// mirror in the plan) both polarisers count as perfect.
  bool correct_leak = true;
  /// Refractive index of the sample's surface. Given, the light that leaks because the plane of
  /// polarisation turns is put back, and specular light is brought to what unpolarised light gives.
  std::optional<double> index;
};

/// What was found of the rig before any texel was developed.
struct RigFindings {
  btf::DirectionSet views;        ///< measured
  btf::DirectionSet lights;       ///< as the plan's light source says
  std::vector<PlaneView> planes;  ///< for each view
  CameraLens lens;
  bool lens_was_calibrated = false;  ///< here, from the views; else the plan gave it
  /// Where the sample's marks are, from where the white target's were; the worst of any view.
  double marks_moved_px = 0;
  ResponseCurve response;
  double response_residual = 0;  ///< of a recovered one, parts of full scale; else 0
  NoiseModel noise;
  bool noise_was_measured = false;  ///< else only the rounding of counts is known
  Contrasts contrasts;              ///< that the separation uses
  Contrasts measured;  ///< of mirror and white as photographed; contrasts where there is no mirror
  bool leak_was_measured = false;
  /// Brightest over dimmest texel of the white target under the light nearest the normal: what
  /// vignetting and fall-off had to be corrected.
  double white_range = 1;
  std::vector<std::string> warnings;
};

/// Figures of one direction pair, all in the unit of a sample.
struct DirectionFindings {
  double masked_fraction = 0;                  ///< of the texels
  std::array<double, 2> saturated_fraction{};  ///< of the pixels of both pictures, every exposure
  double specular_rms = 0, diffuse_rms = 0;
  double specular_noise = 0, diffuse_noise = 0;        ///< rms, as the noise model predicts it
  double specular_negative = 0, diffuse_negative = 0;  ///< part of the samples that are below 0
  double most_negative = 0;
  FresnelPrediction fresnel;  ///< at the index of the options, else 1.5
  /// Part of the step between neighbouring texels by which a texel may be off, since its edges lie
  /// across pixels and the marks are known to a part of one.
  double resampling = 0;
  PredictedError predicted;  ///< at most, of what was developed
  /// With analysers at more than two angles: medians over the texels.
  double degree_of_polarisation = 0;
  double angle_of_polarisation_rad = 0;
};

/// What one light and one view came to.
struct DevelopedDirection {
  int view = 0;
  int light = 0;
  /// Half of what the pictures show behind the analyser, in the unit of a sample: with perfect
  /// polarisers diffuse / 2 + specular, and diffuse / 2.
  Image<Rgb32f> parallel, cross;
  Image<Rgb32f> specular, diffuse;  ///< may be negative by noise
  Image<Rgb32f> specular_variance, diffuse_variance;
  Image<std::uint8_t> masked;
  DirectionFindings findings;
};

/// From the pictures of a session to samples. Both pictures of a direction are divided by those of
/// the white target under the same light, behind the same analyser: that takes out vignetting, the
/// light's fall-off, the pixels' gains and any difference in brightness between both, so that a
/// depolarising target has no contrast left and a mirror the one that extinction and misalignment
/// leave it.
class Developer {
 public:
  /// Finds marks, lens, directions, response, noise and the leak.
  /// @param recording  borrowed; must outlive the developer.
  /// Errors: kNotFound (a picture that is missing, and how to take it), those of its parts.
  [[nodiscard]] static Result<Developer> create(const Recording& recording,
                                                const DevelopmentOptions& options,
                                                Progress& progress);
  Developer(Developer&&) noexcept;
  ~Developer();

  [[nodiscard]] const RigFindings& findings() const;
  [[nodiscard]] const CapturePlan& plan() const;
  /// Errors: kNotFound (the direction was not captured), those of merge().
  [[nodiscard]] Result<DevelopedDirection> develop(int view, int light) const;

 private:
  struct State;
  explicit Developer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::capture
