// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/gog/gog.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "calibration/colour/additive_model.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

struct ChannelFit {
  double offset = 0.0;
  double exponent = 2.2;
  Xyz primary = Xyz::Zero();
  double error = HUGE_VAL;
};

ChannelFit fit_primary(const ChannelRamp& ramp, double offset, double exponent) {
  const GainOffsetGamma curve(offset, exponent);
  const double full = ramp.full().norm();
  double denominator = 0.0;
  Xyz numerator = Xyz::Zero();
  std::vector<double> weights;
  for (std::size_t i = 0; i < ramp.drives.size(); ++i) {
    const double weight = perceptual_weight(ramp.light[i].norm() / full);
    weights.push_back(weight * weight);
    const double value = curve(ramp.drives[i]);
    numerator += weights[i] * value * ramp.light[i];
    denominator += weights[i] * value * value;
  }
  ChannelFit fit{offset, exponent, numerator / denominator, 0.0};
  for (std::size_t i = 0; i < ramp.drives.size(); ++i)
    fit.error += weights[i] * (ramp.light[i] - curve(ramp.drives[i]) * fit.primary).squaredNorm();
  return fit;
}

// Grids of kSide^2 around the best so far, each a third as wide as the one before.
ChannelFit fit_channel(const ChannelRamp& ramp) {
  constexpr int kSide = 13;
  constexpr int kGrids = 12;  // 3^-12 of the range: far below the noise
  using Curve = GainOffsetGamma;
  double offset_range = Curve::kLargestOffset - Curve::kLeastOffset;
  double exponent_range = Curve::kLargestExponent - Curve::kLeastExponent;
  ChannelFit best;
  best.offset = 0.5 * (Curve::kLargestOffset + Curve::kLeastOffset);
  best.exponent = 0.5 * (Curve::kLargestExponent + Curve::kLeastExponent);
  for (int grid = 0; grid < kGrids; ++grid) {
    const ChannelFit centre = best;
    for (int i = 0; i < kSide * kSide; ++i) {
      const double along = static_cast<double>(i % kSide) / (kSide - 1) - 0.5;
      const double across = static_cast<double>(i / kSide) / (kSide - 1) - 0.5;
      const ChannelFit fit = fit_primary(
          ramp,
          std::clamp(
              centre.offset + along * offset_range, Curve::kLeastOffset, Curve::kLargestOffset),
          std::clamp(centre.exponent + across * exponent_range,
                     Curve::kLeastExponent,
                     Curve::kLargestExponent));
      if (fit.error < best.error) best = fit;
    }
    offset_range /= 3.0;
    exponent_range /= 3.0;
  }
  return best;
}

}  // namespace

Result<std::unique_ptr<ColourModel>> fit_gog(std::span<const PatchReading> patches,
                                             const Xyz& black) {
  VENEER_ASSIGN(const ChannelRamps ramps, read_ramps(patches, black));
  const auto light_of = [](const ChannelRamp& ramp) {
    const ChannelFit fit = fit_channel(ramp);
    return ChannelLight(fit.primary, {GainOffsetGamma(fit.offset, fit.exponent)});
  };
  constexpr int kParameters = 3 * (2 + 3);
  return std::make_unique<AdditiveModel>(
      "gog", std::array{light_of(ramps[0]), light_of(ramps[1]), light_of(ramps[2])}, kParameters);
}

}  // namespace veneer::calibration
