// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/projector.h"

#include <algorithm>
#include <cmath>
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

Image<Rgb32f> convolved(const Image<Rgb32f>& in, const std::vector<float>& kernel, int dx, int dy) {
  Image<Rgb32f> out(in.width(), in.height());
  const int radius = static_cast<int>(kernel.size()) - 1;
  parallel_for(in.height(), kRowGrain, [&](std::int64_t begin, std::int64_t end) {
    for (int y = static_cast<int>(begin); y < end; ++y)
      for (int x = 0; x < in.width(); ++x) {
        Rgb32f sum = Rgb32f::Zero();
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
  Spectrum white = Spectrum::Zero();
  const Eigen::Vector3d full = interact(Eigen::Vector3d::Ones());
  for (std::size_t c = 0; c < 3; ++c) {
    primaries_[c] = (1.0 - 2.0 * truth.leak) * lines[c] +
                    truth.leak * (lines[(c + 1) % 3] + lines[(c + 2) % 3]);
    white += full[static_cast<Eigen::Index>(c)] * primaries_[c];
  }
  const double scale = truth.white_nits / xyz_of(white).y();
  for (Spectrum& primary : primaries_) primary *= scale;
  black_ = planckian_spectrum(truth.black_kelvin);
  black_ *= truth.black_fraction * truth.white_nits / xyz_of(black_).y();
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

Eigen::Vector3d VirtualProjector::interact(const Eigen::Vector3d& drive) const {
  const Eigen::Vector3d others =
      0.5 * (Eigen::Vector3d::Constant(drive.sum()) - drive);  // mean of the other two
  return drive.cwiseProduct(Eigen::Vector3d::Ones() - truth_.interaction * others);
}

Eigen::Vector3d VirtualProjector::output(const Rgb16& code) const {
  return interact({tones_[0].at(code[0]), tones_[1].at(code[1]), tones_[2].at(code[2])});
}

Eigen::Vector3d VirtualProjector::drive_towards(const Eigen::Vector3d& output) const {
  // Fixed point of d = output / (1 - interaction * others), cut to the cube; with an interaction of
  // at most 0.3 each step shrinks the error at least to a half, wherever it starts.
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();
  for (int step = 0; step < 40; ++step) {
    const Eigen::Vector3d others = 0.5 * (Eigen::Vector3d::Constant(drive.sum()) - drive);
    drive = output.cwiseQuotient(Eigen::Vector3d::Ones() - truth_.interaction * others)
                .unaryExpr([](double d) { return std::clamp(d, 0.0, 1.0); });
  }
  return drive;
}

Result<Image<Rgb32f>> VirtualProjector::project(ImageView<const Rgb16> codes) const {
  if (codes.width() != truth_.width || codes.height() != truth_.height)
    return fail(Errc::kInvalidOption,
                "projecting a frame on the bench: it has {} x {} pixels, the projector {} x {}",
                codes.width(),
                codes.height(),
                truth_.width,
                truth_.height);
  const auto full = static_cast<std::uint16_t>(tones_[0].size() - 1);
  Image<Rgb32f> light(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y)
    for (int x = 0; x < codes.width(); ++x) {
      const Rgb16& code = codes(x, y);
      if (*std::ranges::max_element(code) > full)
        return fail(
            Errc::kInvalidOption,
            "projecting a frame on the bench: pixel {}, {} has a code over {}; the projector "
            "takes {} bits",
            x,
            y,
            full,
            truth_.bits);
      light(x, y) = output(code).cast<float>();
    }
  return blurred(light, truth_.blur_px);
}

Image<Rgb32f> blurred(const Image<Rgb32f>& image, double sigma) {
  if (!(sigma > 0)) return image;
  const std::vector<float> kernel = half_kernel(sigma);
  return convolved(convolved(image, kernel, 1, 0), kernel, 0, 1);
}

}  // namespace veneer::simulation
