// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/camera/camera_colorimeter.h"

#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace veneer::calibration {
namespace {

/// A sample counts as it is down to this part of the brightest one's luminance; below, noise would
/// get the weight.
constexpr double kLeastWeightedPart = 1e-3;
/// Of the smallest to the largest singular value of the weighted rates; those of real cameras on
/// red, green, blue and white lie above 1e-2.
constexpr double kLeastConditioned = 1e-6;

}  // namespace

Result<CameraMatrix> fit_camera_matrix(std::span<const CameraSample> samples) {
  const auto count = static_cast<Eigen::Index>(samples.size());
  const CameraSample* white = nullptr;
  for (const CameraSample& sample : samples) {
    if (!sample.rate.allFinite() || !sample.xyz.allFinite())
      return fail(Errc::kBadFormat,
                  "fitting a camera's matrix: a sample is not finite; read it again");
    if (white == nullptr || sample.xyz.y() > white->xyz.y()) white = &sample;
  }
  if (count < 4 || !(white->xyz.minCoeff() > 0))
    return fail(Errc::kBadFormat,
                "fitting a camera's matrix: there are {} samples, none of which is white enough; "
                "at least four are needed: show red, green, blue and white",
                count);
  Eigen::MatrixX3d rates(count, 3);
  Eigen::MatrixX3d colours(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const CameraSample& sample = samples[static_cast<std::size_t>(i)];
    const double weight =
        1 / std::max(std::abs(sample.xyz.y()), kLeastWeightedPart * white->xyz.y());
    rates.row(i) = weight * sample.rate;
    colours.row(i) = weight * sample.xyz;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixX3d> solver;
  solver.setThreshold(kLeastConditioned);
  solver.compute(rates);
  if (solver.rank() < 3)
    return fail(Errc::kBadFormat,
                "fitting a camera's matrix: what the camera saw lies in one plane, so that "
                "colours cannot be told apart; show red, green, blue and white, and see that the "
                "camera is not monochrome");
  CameraMatrix result;
  result.xyz_from_rate = solver.solve(colours).transpose();
  for (const CameraSample& sample : samples) {
    const Lab seen = lab_from_xyz(result.xyz_from_rate * sample.rate, white->xyz);
    const double difference = delta_e_2000(seen, lab_from_xyz(sample.xyz, white->xyz));
    result.de00_mean += difference / static_cast<double>(count);
    result.de00_max = std::max(result.de00_max, difference);
  }
  return result;
}

Status CameraColorimeterOptions::check() const {
  if (!xyz_from_rate.allFinite())
    return fail(Errc::kInvalidOption,
                "a camera as colorimeter: the matrix is not finite; fit it on patches of known "
                "colour");
  if (!(black_level >= 0 && black_level <= 0.5))
    return fail(Errc::kInvalidOption,
                "a camera as colorimeter: black_level is {}, set it from 0 to 0.5",
                black_level);
  if (spot_radius < 0 || spot_radius > 1000)
    return fail(Errc::kInvalidOption,
                "a camera as colorimeter: spot_radius is {}, set it from 0 to 1000",
                spot_radius);
  if (frames < 1 || frames > 1000)
    return fail(Errc::kInvalidOption,
                "a camera as colorimeter: frames is {}, set it from 1 to 1000",
                frames);
  return {};
}

CameraColorimeter::CameraColorimeter(capture::Camera& camera,
                                     CameraColorimeterOptions options,
                                     CameraFromProjector camera_from_projector)
    : camera_(camera),
      options_(std::move(options)),
      camera_from_projector_(std::move(camera_from_projector)) {
  VENEER_CHECK(options_.check().has_value());
  VENEER_CHECK(camera_from_projector_ != nullptr);
}

std::string CameraColorimeter::description() const {
  return fmt::format("{} as colorimeter, for the spectra that it was fitted on",
                     camera_.description());
}

Result<Eigen::Vector3d> CameraColorimeter::read_rate(Target target, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d spot = camera_from_projector_(target, pixel);
  const double radius = options_.spot_radius;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int frame = 0; frame < options_.frames; ++frame) {
    VENEER_ASSIGN(const capture::CameraFrame picture, camera_.grab());
    const Image<Rgb16>& counts = picture.counts;
    if (!(spot.x() - radius >= 0 && spot.x() + radius < counts.width() && spot.y() - radius >= 0 &&
          spot.y() + radius < counts.height()))
      return fail(Errc::kNotFound,
                  "reading with a camera: the spot around {:.1f}, {:.1f} is not inside of its "
                  "picture of {} x {} pixels; turn the camera to it",
                  spot.x(),
                  spot.y(),
                  counts.width(),
                  counts.height());
    if (!(picture.exposure_s > 0) || picture.full_scale == 0)
      return fail(Errc::kBadFormat,
                  "reading with a camera: it does not say how long it exposed; use another camera");
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    int pixels = 0;
    const int x0 = static_cast<int>(spot.x());
    const int y0 = static_cast<int>(spot.y());
    const int reach = options_.spot_radius;
    for (int y = std::max(y0 - reach, 0); y <= std::min(y0 + reach, counts.height() - 1); ++y)
      for (int x = std::max(x0 - reach, 0); x <= std::min(x0 + reach, counts.width() - 1); ++x) {
        const bool is_centre = x == x0 && y == y0;
        if (!is_centre && (Eigen::Vector2d(x + 0.5, y + 0.5) - spot).norm() > radius) continue;
        const Rgb16& rgb = counts(x, y);
        if (*std::ranges::max_element(rgb) >= picture.full_scale)
          return fail(Errc::kBadFormat,
                      "reading with a camera: the spot is saturated at {}, {}; expose shorter than "
                      "{:.6f} s",
                      x,
                      y,
                      picture.exposure_s);
        mean += Eigen::Vector3d(rgb[0], rgb[1], rgb[2]);
        ++pixels;
      }
    mean /= static_cast<double>(pixels) * picture.full_scale;
    sum += (mean.array() - options_.black_level).matrix() / picture.exposure_s;
  }
  return Eigen::Vector3d(sum / options_.frames);
}

Result<Xyz> CameraColorimeter::read(Target target, const Eigen::Vector2d& pixel) {
  VENEER_ASSIGN(const Eigen::Vector3d rate, read_rate(target, pixel));
  return Xyz(options_.xyz_from_rate * rate);
}

}  // namespace veneer::calibration
