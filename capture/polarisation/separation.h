// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>

#include "base/result.h"
#include "btf/direction.h"
#include "capture/plan.h"

namespace veneer::capture {

/// Contrasts below which specular and diffuse light look too much alike to be told apart: noise is
/// amplified ten times.
inline constexpr double kLeastContrast = 0.1;

/// Contrast (parallel - cross) / (parallel + cross) of light that kept its polarisation and of
/// light that lost it, of each colour channel. With perfect polarisers 1 and 0. What extinction of
/// either polariser, misalignment and unequal gain of both pictures do is all in these two numbers:
/// with extinctions r_p, r_a and misalignment d, the first is (r_p - 1)/(r_p + 1) (r_a - 1)/(r_a +
/// 1) cos 2d; the cross picture's gain over the parallel one's is (1 - q_d) / (1 + q_d).
struct Contrasts {
  Eigen::Array3d specular = Eigen::Array3d::Ones();  ///< of a mirror, near its normal
  Eigen::Array3d diffuse = Eigen::Array3d::Zero();   ///< of a depolarising target
  Eigen::Array3d specular_deviation =
      Eigen::Array3d::Zero();                                 ///< standard error of each; measure()
  Eigen::Array3d diffuse_deviation = Eigen::Array3d::Zero();  ///< leaves them to its caller

  /// From the mean light of both targets in both pictures, dark taken off.
  /// Errors: kBadFormat (no light; contrasts nearer than kLeastContrast, with which nothing can be
  /// separated: the text says that a polariser is missing or both are crossed the wrong way; a
  /// depolarising target three times as bright in one picture as in the other).
  [[nodiscard]] static Result<Contrasts> measure(const Eigen::Array3d& mirror_parallel,
                                                 const Eigen::Array3d& mirror_cross,
                                                 const Eigen::Array3d& diffuser_parallel,
                                                 const Eigen::Array3d& diffuser_cross);
  /// Of a rig that is known. @param light_extinction, analyser_extinction  at least 1.
  [[nodiscard]] static Contrasts of_rig(double light_extinction,
                                        double analyser_extinction,
                                        double misalignment_rad);
  /// The mirror's contrast with both pictures brought to equal gain: (q_s - q_d) / (1 - q_s q_d).
  [[nodiscard]] Eigen::Array3d of_polarisers() const;
};

/// Standard error of a contrast from the variances of both lights; infinite without light.
[[nodiscard]] Eigen::Array3d contrast_deviation(const Eigen::Array3d& parallel,
                                                const Eigen::Array3d& cross,
                                                const Eigen::Array3d& parallel_variance,
                                                const Eigen::Array3d& cross_variance);

/// Parts of the light of one texel, in the unit of the pictures that they come from.
struct Parts {
  Eigen::Array3d specular = Eigen::Array3d::Zero();
  Eigen::Array3d diffuse = Eigen::Array3d::Zero();
  /// Variances, from those of the pictures; contrasts count as exact.
  Eigen::Array3d specular_variance = Eigen::Array3d::Zero();
  Eigen::Array3d diffuse_variance = Eigen::Array3d::Zero();
};

/// Both pictures are brought to equal gain, P' = P / (1 + q_d) and C' = C / (1 - q_d); then
/// specular = (P' - C') / q with q of of_polarisers(), diffuse = P' + C' - specular; for perfect
/// polarisers P - C and 2 C (Ma et al. 2007, Obara et al. 2006). Both are in the unit of P + C of
/// light that lost its polarisation, so that P + C of a white target is their white. Negative
/// values are kept: noise around zero is no light, and cutting it would add some. Where q is nearer
/// to 0 than kLeastContrast (with_turned_plane() may bring it there), a channel is no number and
/// its variance infinite: to be masked, not guessed.
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
  /// Part of the specular light that turns up in the cross picture; [0, 1]. 0 where there is none.
  double cross_fraction = 0;
  /// facet_reflection() of S0, S1, S2, in units of the reflectance of unpolarised light.
  Eigen::Matrix3d mueller = Eigen::Matrix3d::Identity();
};
/// Errors: kInvalidOption (see facet_reflection(); index below 1; 1 counts as barely above).
[[nodiscard]] Result<FresnelPrediction> predict_fresnel(const btf::Direction& view,
                                                        const btf::Direction& light,
                                                        const PolarisationAxes& axes,
                                                        double index);

/// What is known of a rig beyond its contrasts.
struct RigPolarisation {
  /// Degree of polarisation of the projector's light behind its polariser, (r_p - 1) / (r_p + 1);
  /// in (0, 1].
  double light_degree = 1;
  /// Of the analyser from where it is told to be, counter-clockwise; within pi / 4.
  double misalignment_rad = 0;
};

/// Contrasts with which separate() finds all specular light at that pair: what leaks because the
/// plane of polarisation turns is put back. Exact for a rig that is as said. What a misalignment
/// adds has its sign, so where it is not known the correction pays only away from s and p
/// (docs/polarisation.md has figures).
[[nodiscard]] Contrasts with_turned_plane(const Contrasts& contrasts,
                                          const FresnelPrediction& prediction,
                                          const RigPolarisation& rig = {});

/// Specular light as unpolarised light of the same power would make it: specular / gain. Nothing
/// where the gain is below 0.1: what is nearly out (p-polarised light near Brewster's angle) says
/// nothing of the rest.
[[nodiscard]] std::optional<Eigen::Array3d> unpolarised_specular(
    const Eigen::Array3d& specular,
    const FresnelPrediction& prediction,
    const RigPolarisation& rig = {});
/// How far the gain may be off where the index is: the larger change of both directions. The
/// relative residual of unpolarised_specular() is this over the gain.
/// @param index  at least 1.   @param index_uncertainty  at least 0.
[[nodiscard]] double gain_uncertainty(const FresnelPrediction& prediction,
                                      double index,
                                      double index_uncertainty);

/// Root mean square error to be expected at most of the separation at a pair, in the unit of the
/// light, if with_turned_plane() is not used.
struct PredictedError {
  double specular = 0;
  double diffuse = 0;
};
/// Specular light S whose contrast is rho q where the mirror's is q is found as rho S, and (1 -
/// rho) S goes to the diffuse part, negative where rho is above 1. With m of
/// FresnelPrediction::mueller, p the light's degree of polarisation and d the misalignment,
///
///     rho = [ m10 + p m11 + (m20 + p m21) tan 2d ] / [ p (1 + p m01) ]
///
/// which is 1 - 2 x, x the cross fraction, for p = 1 and d = 0. Of p and d only the product p k cos
/// 2d = q is known, k at most 1, so the worst of them is taken. To it are added, in squares, the
/// noise and what the contrasts' deviations do; the worst channel counts.
/// @param specular_rms  of the texels' specular light.   @param noise_rms  of specular and diffuse.
[[nodiscard]] PredictedError predicted_error(const FresnelPrediction& prediction,
                                             const Contrasts& contrasts,
                                             double specular_rms,
                                             double diffuse_rms,
                                             double specular_noise_rms,
                                             double diffuse_noise_rms);

}  // namespace veneer::capture
