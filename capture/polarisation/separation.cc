// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/separation.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "capture/polarisation/mueller.h"

namespace veneer::capture {
namespace {

using Eigen::Array3d;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::array<std::string_view, 3> kChannels{"red", "green", "blue"};

/// A gain below which there is no specular light whose contrast could be told.
constexpr double kNoGain = 1e-9;
/// The index 1 has no reflectances to compare; just above it their ratio is that of the limit.
constexpr double kLeastIndex = 1 + 1e-6;

double degree_behind(double extinction) { return (1 - 1 / extinction) / (1 + 1 / extinction); }

Status check_light(const Array3d& parallel, const Array3d& cross, std::string_view target) {
  for (int c = 0; c < 3; ++c) {
    const double sum = parallel[c] + cross[c];
    if (!(sum > 0) || !std::isfinite(sum))
      return fail(Errc::kBadFormat,
                  "measuring the polarisers: the {} sends no light in {} ({} parallel, {} cross); "
                  "look whether it was in the picture, lit, and not saturated",
                  target,
                  kChannels[static_cast<std::size_t>(c)],
                  parallel[c],
                  cross[c]);
  }
  return {};
}

Array3d contrast_of(const Array3d& parallel, const Array3d& cross) {
  return (parallel - cross) / (parallel + cross);
}

/// Contrast of specular light in parts of what the mirror has; see predicted_error().
double contrast_ratio(const Eigen::Matrix3d& m, double degree, double tan_twice_misalignment) {
  const double gain = 1 + degree * m(0, 1);
  if (gain < kNoGain) return 1;  // no light that could leak
  const double along = m(1, 0) + degree * m(1, 1);
  const double across = m(2, 0) + degree * m(2, 1);
  return (along + across * tan_twice_misalignment) / (degree * gain);
}

/// The farthest that the ratio may be from 1 for any rig whose mirror has this contrast.
double worst_leak(const Eigen::Matrix3d& m, double contrast) {
  const double least_degree = std::min(contrast, 1.0);
  constexpr int kSteps = 16;
  double worst = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double degree = least_degree + (1 - least_degree) * i / kSteps;
    const double cosine = least_degree / degree;
    const double tangent = std::sqrt(std::max(0.0, 1 - cosine * cosine)) / cosine;
    for (const double turn : {-tangent, 0.0, tangent})
      worst = std::max(worst, std::abs(1 - contrast_ratio(m, degree, turn)));
  }
  return worst;
}

/// (R_s - R_p) / (R_s + R_p).
double diattenuation(double incidence_rad, double index) {
  const FresnelAmplitudes fresnel =
      fresnel_amplitudes(std::cos(incidence_rad), std::max(index, kLeastIndex));
  return (fresnel.s_reflectance() - fresnel.p_reflectance()) / (2 * fresnel.mean_reflectance());
}

}  // namespace

Result<Contrasts> Contrasts::measure(const Array3d& mirror_parallel,
                                     const Array3d& mirror_cross,
                                     const Array3d& diffuser_parallel,
                                     const Array3d& diffuser_cross) {
  VENEER_TRY(check_light(mirror_parallel, mirror_cross, "mirror"));
  VENEER_TRY(check_light(diffuser_parallel, diffuser_cross, "depolarising target"));
  Contrasts contrasts;
  contrasts.specular = contrast_of(mirror_parallel, mirror_cross);
  contrasts.diffuse = contrast_of(diffuser_parallel, diffuser_cross);
  for (int c = 0; c < 3; ++c) {
    const double specular = contrasts.specular[c];
    const double diffuse = contrasts.diffuse[c];
    const std::string_view channel = kChannels[static_cast<std::size_t>(c)];
    if (std::abs(diffuse) > 0.5)
      return fail(
          Errc::kBadFormat,
          "measuring the polarisers: the depolarising target's contrast is {:.2f} in {}: it "
          "is more than three times as bright in one picture; take both with equal light "
          "and exposure, of a target that depolarises (matt white, no paper with a gloss)",
          diffuse,
          channel);
    if (specular - diffuse <= -kLeastContrast)
      return fail(Errc::kBadFormat,
                  "measuring the polarisers: the mirror's contrast of {:.2f} in {} is below the "
                  "depolarising target's of {:.2f}: parallel and cross are exchanged; turn the "
                  "analyser by 90 degrees and measure again",
                  specular,
                  channel,
                  diffuse);
    if (specular - diffuse < kLeastContrast)
      return fail(
          Errc::kBadFormat,
          "measuring the polarisers: the mirror's contrast of {:.2f} in {} is hardly that of "
          "the depolarising target, {:.2f}: a polariser is missing, or both stand at 45 "
          "degrees to each other; mount both, turn the analyser until the mirror is "
          "brightest, and measure again",
          specular,
          channel,
          diffuse);
  }
  return contrasts;
}

Contrasts Contrasts::of_rig(double light_extinction,
                            double analyser_extinction,
                            double misalignment_rad) {
  Contrasts contrasts;
  contrasts.specular.setConstant(degree_behind(light_extinction) *
                                 degree_behind(analyser_extinction) *
                                 std::cos(2 * misalignment_rad));
  return contrasts;
}

Array3d Contrasts::of_polarisers() const { return (specular - diffuse) / (1 - specular * diffuse); }

Array3d contrast_deviation(const Array3d& parallel,
                           const Array3d& cross,
                           const Array3d& parallel_variance,
                           const Array3d& cross_variance) {
  const Array3d sum = parallel + cross;
  const Array3d deviation =
      2 * (cross.square() * parallel_variance + parallel.square() * cross_variance).sqrt() /
      sum.square();
  return (sum > 0).select(deviation, Array3d::Constant(kInfinity));
}

Parts separate(const Array3d& parallel,
               const Array3d& cross,
               const Array3d& parallel_variance,
               const Array3d& cross_variance,
               const Contrasts& contrasts) {
  const Array3d contrast = contrasts.of_polarisers();
  // Nothing is divided by what is too little.
  const Array3d q =
      (contrast.abs() >= kLeastContrast)
          .select(contrast, Array3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  const Array3d of_parallel = 1 / (1 + contrasts.diffuse);
  const Array3d of_cross = 1 / (1 - contrasts.diffuse);
  const Array3d p = parallel * of_parallel;
  const Array3d c = cross * of_cross;
  const Array3d p_variance = parallel_variance * of_parallel.square();
  const Array3d c_variance = cross_variance * of_cross.square();
  Parts parts;
  parts.specular = (p - c) / q;
  parts.diffuse = p * (1 - 1 / q) + c * (1 + 1 / q);
  parts.specular_variance = (p_variance + c_variance) / q.square();
  parts.diffuse_variance = p_variance * (1 - 1 / q).square() + c_variance * (1 + 1 / q).square();
  for (int channel = 0; channel < 3; ++channel)
    if (std::isnan(q[channel]))
      parts.specular_variance[channel] = parts.diffuse_variance[channel] = kInfinity;
  return parts;
}

Result<FresnelPrediction> predict_fresnel(const btf::Direction& view,
                                          const btf::Direction& light,
                                          const PolarisationAxes& axes,
                                          double index) {
  const double usable = index == 1 ? kLeastIndex : index;
  VENEER_ASSIGN(const Mueller reflection,
                facet_reflection(light, view, axes.axis, axes.axis, usable));
  const Eigen::Vector3d to_light = light.normalized();
  const Eigen::Vector3d to_view = view.normalized();
  FresnelPrediction prediction;
  prediction.incidence_rad = std::atan2((to_light - to_view).norm(), (to_light + to_view).norm());
  const Eigen::Vector3d s = to_light.cross(to_view);
  const Eigen::Vector3d axis = axes.axis - axes.axis.dot(to_light) * to_light;
  prediction.azimuth_rad = std::atan2(s.cross(axis).norm(), std::abs(s.dot(axis)));
  prediction.mueller = reflection.topLeftCorner<3, 3>() / reflection(0, 0);
  prediction.gain = std::max(0.0, 1 + prediction.mueller(0, 1));
  if (prediction.gain > kNoGain) {
    const double kept = contrast_ratio(prediction.mueller, 1, 0);
    prediction.cross_fraction = std::clamp(0.5 * (1 - kept), 0.0, 1.0);
  }
  return prediction;
}

Contrasts with_turned_plane(const Contrasts& contrasts,
                            const FresnelPrediction& prediction,
                            const RigPolarisation& rig) {
  VENEER_CHECK(rig.light_degree > 0 && rig.light_degree <= 1);
  const double ratio =
      contrast_ratio(prediction.mueller, rig.light_degree, std::tan(2 * rig.misalignment_rad));
  // The turn acts on what the polarisers do; the gain between both pictures stays.
  const Array3d q = contrasts.of_polarisers();
  const Array3d turned = ratio * q;
  Contrasts result = contrasts;
  result.specular = (turned + contrasts.diffuse) / (1 + turned * contrasts.diffuse);
  const Array3d gain_slope = (1 + q * contrasts.diffuse) / (1 + turned * contrasts.diffuse);
  result.specular_deviation = contrasts.specular_deviation * std::abs(ratio) * gain_slope.square();
  return result;
}

std::optional<Array3d> unpolarised_specular(const Array3d& specular,
                                            const FresnelPrediction& prediction,
                                            const RigPolarisation& rig) {
  constexpr double kLeastGain = 0.1;
  const double gain = 1 + rig.light_degree * (prediction.gain - 1);
  if (!(gain >= kLeastGain)) return std::nullopt;
  return specular / gain;
}

double gain_uncertainty(const FresnelPrediction& prediction,
                        double index,
                        double index_uncertainty) {
  const auto gain = [&](double at) {
    return 1 + diattenuation(prediction.incidence_rad, at) * std::cos(2 * prediction.azimuth_rad);
  };
  const double here = gain(index);
  return std::max(std::abs(gain(index + index_uncertainty) - here),
                  std::abs(gain(index - index_uncertainty) - here));
}

PredictedError predicted_error(const FresnelPrediction& prediction,
                               const Contrasts& contrasts,
                               double specular_rms,
                               double diffuse_rms,
                               double specular_noise_rms,
                               double diffuse_noise_rms) {
  const double q = contrasts.of_polarisers().minCoeff();
  if (!(q >= kLeastContrast)) return {kInfinity, kInfinity};
  const double leaked = worst_leak(prediction.mueller, q) * specular_rms;
  // First order in the deviations: q_s scales specular light, q_d takes it from diffuse light.
  const double of_mirror = contrasts.specular_deviation.maxCoeff() * specular_rms / q;
  const double of_diffuser =
      contrasts.diffuse_deviation.maxCoeff() * (diffuse_rms / q + specular_rms);
  const double common = std::hypot(leaked, of_mirror, of_diffuser);
  return {std::hypot(common, specular_noise_rms), std::hypot(common, diffuse_noise_rms)};
}

}  // namespace veneer::capture
