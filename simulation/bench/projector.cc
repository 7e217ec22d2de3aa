// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/projector.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/parallel.h"

namespace veneer::simulation {
namespace {

/// Rows of an image that one thread takes at a time.
constexpr int kRowGrain = 16;

double tone(const ChannelTruth& channel, double drive) {
  if (channel.tone == ChannelTruth::Tone::kPower) return std::pow(drive, channel.exponent);
  return (1.0 + channel.c) * std::pow(drive, channel.a) / (std::pow(drive, channel.b) + channel.c);
}

/// Weights of the pixels at distance 0, 1, ... ; their two-sided sum is 1.
std::vector<float> half_kernel(double sigma) {
  // Cut where less than 1e-6 of the light lies beyond.
  const int radius = static_cast<int>(std::ceil(5.0 * sigma + 0.5));
  const auto below = [sigma](double x) {
    return 0.5 * std::erfc(-x / (sigma * std::numbers::sqrt2));
  };
  std::vector<double> weights;
  double sum = 0;
  for (int i = 0; i <= radius; ++i) {
    weights.push_back(below(i + 0.5) - below(i - 0.5));
    sum += (i == 0 ? 1.0 : 2.0) * weights.back();
  }
  std::vector<float> kernel;
  kernel.reserve(weights.size());
  for (const double weight : weights) kernel.push_back(static_cast<float>(weight / sum));
  return kernel;
}

template <class Pixel>
Image<Pixel> convolved(const Image<Pixel>& in, const std::vector<float>& kernel, int dx, int dy) {
  Image<Pixel> out(in.width(), in.height());
  const int radius = static_cast<int>(kernel.size()) - 1;
  parallel_for(in.height(), kRowGrain, [&](std::int64_t begin, std::int64_t end) {
    for (int y = static_cast<int>(begin); y < end; ++y)
      for (int x = 0; x < in.width(); ++x) {
        Pixel sum = Pixel::Zero();
        for (int i = -radius; i <= radius; ++i) {
          const int sx = x + i * dx;
          const int sy = y + i * dy;
          if (sx >= 0 && sx < in.width() && sy >= 0 && sy < in.height())
            sum += kernel[static_cast<std::size_t>(std::abs(i))] * in(sx, sy);
        }
        out(x, y) = sum;
      }
  });
  return out;
}

template <class Pixel>
Image<Pixel> blurred_by(const Image<Pixel>& image, double sigma) {
  if (!(sigma > 0)) return image;
  const std::vector<float> kernel = half_kernel(sigma);
  return convolved(convolved(image, kernel, 1, 0), kernel, 0, 1);
}

}  // namespace

VirtualProjector::VirtualProjector(const ProjectorTruth& truth)
    : truth_(truth), projector_from_world_(truth.world_from_projector.inverse()) {
  const int codes = 1 << truth.bits;
  for (std::size_t c = 0; c < 3; ++c)
    for (int code = 0; code < codes; ++code)
      tones_[c].push_back(tone(truth.channels[c], code / (codes - 1.0)));

  std::array<Spectrum, 3> lines;
  for (std::size_t c = 0; c < 3; ++c) {
    const ChannelTruth& channel = truth.channels[c];
    lines[c] = channel.power * gaussian_spectrum(channel.centre_nm, channel.width_nm);
  }
  Spectrum sum = Spectrum::Zero();
  const Outputs full = interact(Eigen::Vector3d::Ones());
  for (std::size_t c = 0; c < 3; ++c) {
    primaries_[c] = (1.0 - 2.0 * truth.leak) * lines[c] +
                    truth.leak * (lines[(c + 1) % 3] + lines[(c + 2) % 3]);
    sum += full[static_cast<Eigen::Index>(c)] * primaries_[c];
  }
  const double scale = (1.0 - truth.white_segment) * truth.white_nits / xyz_of(sum).y();
  for (std::size_t c = 0; c < 3; ++c) primaries_[c] *= scale;
  for (std::size_t c = 0; c < 3; ++c) {
    const Spectrum others = primaries_[(c + 1) % 3] + primaries_[(c + 2) % 3];
    primaries_[3 + c] = others * (xyz_of(primaries_[c]).y() / xyz_of(others).y());
  }
  primaries_[kSegment] =
      planckian_light(truth.white_segment_kelvin, truth.white_segment * truth.white_nits);
  black_ = planckian_light(truth.black_kelvin, truth.black_fraction * truth.white_nits);
}

std::optional<Eigen::Vector2d> VirtualProjector::pixel_of(const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d x = projector_from_world_ * x_in_world;
  if (!(x.z() > 0)) return std::nullopt;
  const Eigen::Vector2d pixel =
      truth_.focal_px.cwiseProduct(x.head<2>() / x.z()) + truth_.principal_point;
  const bool on_raster =
      pixel.minCoeff() >= 0 && pixel.x() < truth_.width && pixel.y() < truth_.height;
  return on_raster ? std::optional(pixel) : std::nullopt;
}

double VirtualProjector::axis_cosine(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d slope = (pixel - truth_.principal_point).cwiseQuotient(truth_.focal_px);
  return 1.0 / std::sqrt(1.0 + slope.squaredNorm());
}

double VirtualProjector::raw_vignetting(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d half(0.5 * truth_.width, 0.5 * truth_.height);
  const Eigen::Vector2d q = (pixel - half) / half.norm() - truth_.vignetting_off_centre;
  return std::pow(axis_cosine(pixel), truth_.vignetting_exponent) *
         (1.0 - truth_.vignetting_drop * q.squaredNorm());
}

double VirtualProjector::vignetting(const Eigen::Vector2d& pixel) const {
  return raw_vignetting(pixel) / raw_vignetting({0.5 * truth_.width, 0.5 * truth_.height});
}

VirtualProjector::Outputs VirtualProjector::interact(const Eigen::Vector3d& drive) const {
  return outputs_with_segment(drive, drive.minCoeff());
}

VirtualProjector::Outputs VirtualProjector::outputs_with_segment(const Eigen::Vector3d& drive,
                                                                 double least) const {
  const Eigen::Array3d others =
      0.5 * (Eigen::Vector3d::Constant(drive.sum()) - drive);  // mean of the other two
  const Eigen::Array3d light = drive.array() * (1.0 - truth_.interaction * others);
  const Eigen::Array3d drifted = truth_.chromaticity_drift * (1.0 - drive.array());
  Outputs outputs;
  outputs.head<3>() = light * (1.0 - drifted);
  outputs.segment<3>(3) = light * drifted;
  outputs[kSegment] =
      truth_.white_segment > 0 ? std::pow(least, truth_.white_segment_exponent) : 0.0;
  return outputs;
}

Eigen::Matrix<double, VirtualProjector::kOutputs, 3> VirtualProjector::slope(
    const Eigen::Vector3d& drive, int least) const {
  Eigen::Matrix<double, kOutputs, 3> slope = Eigen::Matrix<double, kOutputs, 3>::Zero();
  for (int c = 0; c < 3; ++c) {
    const double others = 0.5 * (drive.sum() - drive[c]);
    const double light = drive[c] * (1.0 - truth_.interaction * others);
    const double drifted = truth_.chromaticity_drift * (1.0 - drive[c]);
    for (int k = 0; k < 3; ++k) {
      const double light_slope =
          k == c ? 1.0 - truth_.interaction * others : -0.5 * truth_.interaction * drive[c];
      const double drifted_slope = k == c ? -truth_.chromaticity_drift : 0.0;
      slope(c, k) = light_slope * (1.0 - drifted) - light * drifted_slope;
      slope(3 + c, k) = light_slope * drifted + light * drifted_slope;
    }
  }
  const double exponent = truth_.white_segment_exponent;
  slope(kSegment, least) = exponent * std::pow(drive[least], exponent - 1.0);
  return slope;
}

VirtualProjector::Outputs VirtualProjector::output(const Rgb16& code) const {
  return interact({tones_[0].at(code[0]), tones_[1].at(code[1]), tones_[2].at(code[2])});
}

Eigen::Vector3d VirtualProjector::newton(const SurfaceOutputs& surface,
                                         const Xyz& xyz,
                                         int least,
                                         Eigen::Vector3d drive) const {
  const auto missing = [&](const Eigen::Vector3d& d) -> Xyz {
    return xyz - surface * outputs_with_segment(d, d[least]);
  };
  constexpr int kSteps = 60;
  constexpr int kHalvings = 12;
  Xyz rest = missing(drive);
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::Matrix3d jacobian = surface * slope(drive, least);
    const Eigen::Vector3d move = jacobian.fullPivLu().solve(rest);
    double length = 1;
    bool closer = false;
    for (int halving = 0; halving < kHalvings && !closer; ++halving, length *= 0.5) {
      const Eigen::Vector3d trial = (drive + length * move).cwiseMax(0.0).cwiseMin(1.0);
      const Xyz trial_rest = missing(trial);
      closer = trial_rest.norm() < rest.norm();  // false for NaN
      if (!closer) continue;
      drive = trial;
      rest = trial_rest;
    }
    if (!closer) break;
  }
  return drive;
}

Eigen::Vector3d VirtualProjector::drive_towards(const SurfaceOutputs& surface,
                                                const Xyz& xyz) const {
  if (!xyz.allFinite()) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  // The segment follows the least of the drives, whose place is not known beforehand: with each
  // channel taken for it the light is a smooth function, and one of the three is the true one.
  const bool segment = truth_.white_segment > 0;
  // Where Newton starts: the answer of the primaries alone, and, for light that bends more, from
  // dark, middle and full drive.
  const Eigen::Matrix3d primaries = surface.leftCols<3>();
  const Eigen::Vector3d linear = (primaries.fullPivLu().solve(xyz)).cwiseMax(0.0).cwiseMin(1.0);
  const double close = 1e-12 * xyz.norm();
  Eigen::Vector3d best = linear;
  double least_miss = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& start : {linear,
                                       Eigen::Vector3d::Constant(0.5).eval(),
                                       Eigen::Vector3d::Constant(0.05).eval(),
                                       Eigen::Vector3d::Ones().eval()})
    for (int least = 0; least < (segment ? 3 : 1); ++least) {
      const Eigen::Vector3d drive = newton(surface, xyz, least, start);
      const double miss = (xyz - surface * interact(drive)).norm();
      if (!(miss < least_miss)) continue;
      least_miss = miss;
      best = drive;
      if (miss <= close) return best;
    }
  return best;
}

Status VirtualProjector::check_frame(ImageView<const Rgb16> codes) const {
  if (codes.width() != truth_.width || codes.height() != truth_.height)
    return fail(Errc::kInvalidOption,
                "projecting a frame on the bench: it has {} x {} pixels, the projector {} x {}",
                codes.width(),
                codes.height(),
                truth_.width,
                truth_.height);
  const auto full = static_cast<std::uint16_t>(tones_[0].size() - 1);
  for (int y = 0; y < codes.height(); ++y)
    for (int x = 0; x < codes.width(); ++x)
      if (*std::ranges::max_element(codes(x, y)) > full)
        return fail(
            Errc::kInvalidOption,
            "projecting a frame on the bench: pixel {}, {} has a code over {}; the projector "
            "takes {} bits",
            x,
            y,
            full,
            truth_.bits);
  return {};
}

Result<Image<VirtualProjector::Light>> VirtualProjector::project(
    ImageView<const Rgb16> codes) const {
  VENEER_TRY(check_frame(codes));
  Image<Light> light(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y)
    for (int x = 0; x < codes.width(); ++x) light(x, y) = output(codes(x, y)).cast<float>();
  return blurred(light, truth_.blur_px);
}

Result<Image<Rgb32f>> VirtualProjector::project(
    ImageView<const Rgb16> codes, const Eigen::Matrix<float, 3, kOutputs>& channels) const {
  VENEER_TRY(check_frame(codes));
  Image<Rgb32f> seen(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y)
    for (int x = 0; x < codes.width(); ++x)
      seen(x, y) = channels * output(codes(x, y)).cast<float>();
  return blurred(seen, truth_.blur_px);
}

Image<VirtualProjector::Light> blurred(const Image<VirtualProjector::Light>& image, double sigma) {
  return blurred_by(image, sigma);
}
Image<Rgb32f> blurred(const Image<Rgb32f>& image, double sigma) { return blurred_by(image, sigma); }

}  // namespace veneer::simulation
