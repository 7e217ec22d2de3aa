// SPDX-License-Identifier: Apache-2.0
#include "render/compensation.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/ipt.h"
#include "render/dither.h"

namespace veneer::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The curve of a display that follows IEC 61966-2-1.
std::vector<double> srgb_curve(int bits) {
  std::vector<double> curve(std::size_t{1} << static_cast<unsigned>(bits));
  for (std::size_t i = 0; i < curve.size(); ++i)
    curve[i] = srgb_decode(static_cast<double>(i) / static_cast<double>(curve.size() - 1));
  return curve;
}

std::array<ToneLevels, 3> levels_of(const calibration::ProjectorProfile& profile, bool compensate) {
  if (compensate) {
    const auto& curves = profile.tone_curves;
    return {ToneLevels(curves[0]), ToneLevels(curves[1]), ToneLevels(curves[2])};
  }
  const ToneLevels srgb(srgb_curve(profile.bits));
  return {srgb, srgb, srgb};
}

Compensation::Constants constants_of(const calibration::ProjectorProfile& profile,
                                     const RendererOptions& options) {
  Compensation::Constants c;
  c.compensate = options.compensate;
  c.dither = options.dither;
  const Xyz full = profile.emitted(Vector3d::Ones());
  if (options.compensate) {
    c.geometry_floor = options.geometry_floor;
    const Matrix3d inverse_primaries = profile.primaries.inverse();
    c.drive_from_target = inverse_primaries * profile.surface.inverse();
    c.drive_of_ambient = inverse_primaries * profile.ambient;
    c.drive_of_black = inverse_primaries * profile.black;
  } else {
    c.geometry_floor = 0;
    c.drive_from_target = srgb_from_xyz() / full.y();
    c.drive_of_ambient = Vector3d::Zero();
    c.drive_of_black = Vector3d::Zero();
  }
  const Xyz white = full + profile.black;
  const Vector3d white_cones = cones_from_xyz() * white;
  c.cones_from_target = white_cones.cwiseInverse().asDiagonal() * cones_from_xyz();
  c.drive_from_cones = c.drive_from_target * c.cones_from_target.inverse();
  c.cones_from_drive = c.drive_from_cones.inverse();
  c.drive_of_white = c.drive_from_target * white;
  return c;
}

using Codes = std::array<std::uint16_t, 3>;

Codes chosen(const std::array<ToneLevels::Bracket, 3>& brackets, const Vector3d& thresholds) {
  Codes codes{};
  for (std::size_t i = 0; i < 3; ++i) {
    const ToneLevels::Bracket& b = brackets[i];
    codes[i] = b.fraction > thresholds[static_cast<Eigen::Index>(i)] ? b.upper : b.lower;
  }
  return codes;
}
// The highest that any threshold chooses.
Codes highest(const std::array<ToneLevels::Bracket, 3>& brackets) {
  return chosen(brackets, Vector3d::Zero());
}

bool is_inside(const Vector3d& drive, double tolerance) {
  return drive.minCoeff() >= -tolerance && drive.maxCoeff() <= 1.0 + tolerance;
}

}  // namespace

Compensation::Compensation(const calibration::ProjectorProfile& profile,
                           const RendererOptions& options)
    : constants_(constants_of(profile, options)),
      ceiling_(profile, options.luminance_ceiling),
      correction_(options.compensate ? calibration::DriveCorrection(profile.residual)
                                     : calibration::DriveCorrection()),
      tone_levels_(levels_of(profile, options.compensate)) {}

// pixel.drive holds t as solved for `wanted_drive`, outside [0, 1]; leaves it inside, with the
// loss.
void Compensation::map_to_gamut(const Xyz& target,
                                const Vector3d& wanted_drive,
                                double g,
                                const Vector3d& reflectance,
                                CompensatedPixel& pixel) const {
  const Constants& c = constants_;
  const Vector3d gain = g * reflectance;
  const Vector3d offset = c.drive_of_ambient / g + c.drive_of_black;
  const auto drive_of = [&](const Vector3d& cones) -> Vector3d {
    return correction_((c.drive_from_cones * cones).cwiseQuotient(gain) - offset);
  };
  const Ipt wanted = ipt_from_cones(c.cones_from_target * target);

  // The neutral s W needs the drive s a - offset: reachable for s in [darkest, brightest], but for
  // the correction.
  const Vector3d full = correction_.axes().full;
  double darkest = 0.0;
  double brightest = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    const double a = c.drive_of_white[i] / gain[i];
    const double at_zero = offset[i] / a;
    const double at_one = (full[i] + offset[i]) / a;
    darkest = std::max(darkest, std::min(at_zero, at_one));
    brightest = std::min(brightest, std::max(at_zero, at_one));
  }
  bool any_neutral = darkest <= brightest;
  double low = std::pow(darkest, kIptExponent);
  double high = std::pow(brightest, kIptExponent);
  if (!correction_.empty() && any_neutral) {
    // A neutral gets brighter with every channel: the darkest is the first whose least channel is
    // not below 0, the brightest the last whose largest is not above 1.
    const auto neutral = [&](double lightness) {
      return drive_of(cones_from_ipt({lightness, 0.0, 0.0}));
    };
    double step = 0.5 * (high - low);
    std::swap(low, high);
    for (int i = 0; i < kGamutSteps; ++i, step *= 0.5) {
      if (neutral(low - step).minCoeff() >= 0.0) low -= step;
      if (neutral(high + step).maxCoeff() <= 1.0) high += step;
    }
    any_neutral = low <= high;
  }
  if (!any_neutral) {
    const Vector3d clamped = pixel.drive.cwiseMax(0.0).cwiseMin(1.0);
    const Vector3d shown_drive =
        correction_.empty() ? clamped : wanted_drive + (clamped - pixel.drive);
    const Vector3d shown = c.cones_from_drive * (shown_drive + offset).cwiseProduct(gain);
    pixel.drive = clamped;
    pixel.gamut_loss = 100.0 * (wanted - ipt_from_cones(shown)).norm();
    return;
  }
  const double quarter = 0.25 * (high - low);
  const Ipt anchor(std::clamp(wanted.x(), low + quarter, high - quarter), 0.0, 0.0);
  const Ipt way = wanted - anchor;
  double kept = 0.0;
  double step = 0.5;
  for (int i = 0; i < kGamutSteps; ++i, step *= 0.5) {
    if (is_inside(drive_of(cones_from_ipt(anchor + (kept + step) * way)), 0.0)) kept += step;
  }
  pixel.drive = drive_of(cones_from_ipt(anchor + kept * way)).cwiseMax(0.0).cwiseMin(1.0);
  pixel.gamut_loss = 100.0 * (1.0 - kept) * way.norm();
}

Compensation::Brackets Compensation::brackets(const Vector3d& drive) const {
  return {tone_levels_[0].bracket(drive[0]),
          tone_levels_[1].bracket(drive[1]),
          tone_levels_[2].bracket(drive[2])};
}

void Compensation::hold(const Vector3d& thresholds, CompensatedPixel& pixel) const {
  const Codes before = highest(brackets(pixel.drive));
  if (ceiling_.allows(before)) return;
  pixel.held = before != Codes{};  // what is off cannot be brought down
  // In proportion to the light, which with a residual the drive is not.
  const Vector3d sent =
      correction_.empty() ? pixel.drive : Vector3d(pixel.drive + ceiling_.residual()(pixel.drive));
  const auto scaled = [&](double root) -> Vector3d {
    return correction_(root * root * sent).cwiseMax(0.0).cwiseMin(1.0);
  };
  double root = 0.0;
  double step = 0.5;
  for (int i = 0; i < kCeilingSteps; ++i, step *= 0.5) {
    if (ceiling_.allows(highest(brackets(scaled(root + step))))) root += step;
  }
  pixel.drive = root > 0.0 ? scaled(root) : Vector3d::Zero();
  const Brackets under = brackets(pixel.drive);
  pixel.codes = chosen(under, thresholds);
  if (!ceiling_.allows(pixel.codes)) pixel.codes = highest(under);
}

CompensatedPixel Compensation::pixel(const Xyz& target,
                                     double geometry,
                                     double vignetting,
                                     const Vector3d& reflectance,
                                     std::uint32_t x,
                                     std::uint32_t y,
                                     std::uint32_t dither_seed) const {
  CompensatedPixel result;
  if (geometry <= 0.0) return result;
  const double g = constants_.compensate ? geometry * vignetting : 1.0;
  if (!target.allFinite() || !std::isfinite(geometry) || !(g >= constants_.geometry_floor)) {
    result.state = PixelState::kOutOfReach;
    return result;
  }
  result.state = PixelState::kInGamut;
  const Vector3d s = constants_.compensate ? reflectance : Vector3d::Ones();
  const Vector3d wanted_drive =
      ((constants_.drive_from_target * target).cwiseQuotient(s) - constants_.drive_of_ambient) / g -
      constants_.drive_of_black;
  result.drive = correction_(wanted_drive);
  if (!is_inside(result.drive, kGamutTolerance)) {
    result.state = PixelState::kOutOfGamut;
    if (constants_.compensate) map_to_gamut(target, wanted_drive, g, s, result);
  }
  result.drive = result.drive.cwiseMax(0.0).cwiseMin(1.0);
  Vector3d thresholds = Vector3d::Constant(0.5);
  if (constants_.dither) {
    for (std::uint32_t i = 0; i < 3; ++i) thresholds[i] = dither_threshold(x, y, i, dither_seed);
  }
  result.codes = chosen(brackets(result.drive), thresholds);
  if (ceiling_.active()) hold(thresholds, result);
  return result;
}

Image<float> vignetting_raster(const calibration::ProjectorProfile& profile) {
  Image<float> raster(profile.geometry.width, profile.geometry.height);
  for (int y = 0; y < raster.height(); ++y) {
    for (int x = 0; x < raster.width(); ++x)
      raster(x, y) = static_cast<float>(profile.vignetting_at({x + 0.5, y + 0.5}));
  }
  return raster;
}

Image<Rgb32f> reflectance_raster(const calibration::ProjectorProfile& profile) {
  if (profile.surface_map.empty()) return {1, 1, Rgb32f::Ones()};
  Image<Rgb32f> raster(profile.geometry.width, profile.geometry.height);
  for (int y = 0; y < raster.height(); ++y) {
    for (int x = 0; x < raster.width(); ++x)
      raster(x, y) = profile.reflectance_at({x + 0.5, y + 0.5}).cast<float>();
  }
  return raster;
}

}  // namespace veneer::render
