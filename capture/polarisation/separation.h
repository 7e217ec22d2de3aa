// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/result.h"
#include "btf/direction.h"
#include "capture/plan.h"

namespace veneer::capture {

/// Contrast (parallel - cross) / (parallel + cross) of light that kept its polarisation and of
/// light that lost it, of each colour channel. With perfect polarisers 1 and 0. What extinction of
/// either polariser, misalignment and unequal gain of both pictures do is all in these two numbers:
/// with extinctions r_p, r_a and misalignment d, the first is (r_p - 1)/(r_p + 1) (r_a - 1)/(r_a +
/// 1) cos 2d.
struct Contrasts {
  Eigen::Array3d specular = Eigen::Array3d::Ones();            ///< of a mirror
  Eigen::Array3d diffuse = Eigen::Array3d::Zero();             ///< of a depolarising target
  Eigen::Array3d specular_deviation = Eigen::Array3d::Zero();  ///< standard error of each
  Eigen::Array3d diffuse_deviation = Eigen::Array3d::Zero();

  /// From the mean light of both targets in both pictures, dark taken off.
  /// Errors: kBadFormat (no light; contrasts nearer than 0.1, with which nothing can be separated:
  /// the text says that a polariser is missing or both are crossed the wrong way).
  [[nodiscard]] static Result<Contrasts> measure(const Eigen::Array3d& mirror_parallel,
                                                 const Eigen::Array3d& mirror_cross,
                                                 const Eigen::Array3d& diffuser_parallel,
                                                 const Eigen::Array3d& diffuser_cross);
};

/// Parts of the light of one texel, in the unit of the pictures that they come from.
struct Parts {
  Eigen::Array3d specular = Eigen::Array3d::Zero();
  Eigen::Array3d diffuse = Eigen::Array3d::Zero();
  /// Variances, from those of the pictures; contrasts count as exact.
  Eigen::Array3d specular_variance = Eigen::Array3d::Zero();
  Eigen::Array3d diffuse_variance = Eigen::Array3d::Zero();
};

/// With sum P + C and difference P - C: specular = (difference - q_d sum) / (q_s - q_d), diffuse =
/// sum - specular; for perfect polarisers P - C and 2 C (Ma et al. 2007, Obara et al. 2006).
/// Negative values are kept: noise around zero is no light, and cutting it would add some.
[[nodiscard]] Parts separate(const Eigen::Array3d& parallel,
                             const Eigen::Array3d& cross,
                             const Eigen::Array3d& parallel_variance,
                             const Eigen::Array3d& cross_variance,
                             const Contrasts& contrasts);

/// What polarised light does at a pair of directions that no mirror can calibrate, for a
/// dielectric.
struct FresnelPrediction {
  double incidence_rad = 0;  ///< on the facet that mirrors: half the angle between light and view
  double azimuth_rad = 0;    ///< of the light's axis from s, [0, pi / 2]
  /// Specular light under the rig's polarised light over that under unpolarised light of the same
  /// power.
  double gain = 1;
  /// Part of the specular light that turns up in the cross picture; [0, 1].
  double cross_fraction = 0;
};
/// Errors: kInvalidOption (see facet_reflection(); index below 1).
[[nodiscard]] Result<FresnelPrediction> predict_fresnel(const btf::Direction& view,
                                                        const btf::Direction& light,
                                                        const PolarisationAxes& axes,
                                                        double index);

/// Contrasts with which separate() finds all specular light at that pair: what leaks because the
/// plane of polarisation turns is put back.
[[nodiscard]] Contrasts with_turned_plane(const Contrasts& contrasts,
                                          const FresnelPrediction& prediction);

/// Root mean square error to be expected of the separation at a pair, in the unit of the light, if
/// with_turned_plane() is not used.
struct PredictedError {
  double specular = 0;
  double diffuse = 0;
};
/// @param specular_rms  of the texels' specular light.   @param noise_rms  of specular and diffuse.
[[nodiscard]] PredictedError predicted_error(const FresnelPrediction& prediction,
                                             const Contrasts& contrasts,
                                             double specular_rms,
                                             double diffuse_rms,
                                             double specular_noise_rms,
                                             double diffuse_noise_rms);

}  // namespace veneer::capture
