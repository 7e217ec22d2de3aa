// SPDX-License-Identifier: Apache-2.0
#include "calibration/spot_fall_off.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "calibration/interpolation.h"

namespace veneer::calibration {
namespace {

/// Spots at the very edge would not lie in the picture whole; this part of the raster is left out
/// on each side and extrapolated over.
constexpr double kMargin = 0.03;
/// Texels of the map at most: half a texel, which bilinear lookup cannot extrapolate over, is then
/// under 1 % of the raster.
constexpr int kWidth = 64;
constexpr int kHeight = 48;

std::vector<double> spots(int count, int extent) {
  std::vector<double> at;
  at.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    at.push_back(std::lerp(kMargin, 1.0 - kMargin, i / (count - 1.0)) * extent);
  return at;
}

Result<double> read_spot(ReadingSession& session,
                         const ProjectorGeometry& geometry,
                         const Eigen::Vector2d& pixel,
                         const Xyz& ambient) {
  const std::string what = fmt::format("white at pixel {:.0f}, {:.0f}", pixel.x(), pixel.y());
  VENEER_ASSIGN(const Xyz reading, session.read(Target::kWhiteReference, pixel, 1, what));
  const double light = reading.y() - ambient.y();
  if (!(light > 0))
    return fail(Errc::kBadFormat,
                "reading {}: there is no light above the ambient; does the board fill the picture?",
                what);
  return light / std::pow(axis_cosine(geometry, pixel), 3);
}

}  // namespace

double axis_cosine(const ProjectorGeometry& geometry, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray(
      (pixel.x() - geometry.cx) / geometry.fx, (pixel.y() - geometry.cy) / geometry.fy, 1.0);
  return 1.0 / ray.norm();
}

Result<Image<float>> read_spot_fall_off(ReadingSession& session,
                                        const ProjectorGeometry& geometry,
                                        int columns,
                                        int rows,
                                        const Xyz& ambient) {
  const std::vector<double> xs = spots(columns, geometry.width);
  const std::vector<double> ys = spots(rows, geometry.height);
  const int width = std::min(kWidth, geometry.width);
  const int height = std::min(kHeight, geometry.height);
  // The reference is the raster's centre, read in the same run so that lamp drift matters little.
  VENEER_ASSIGN(
      const double reference,
      read_spot(session, geometry, {0.5 * geometry.width, 0.5 * geometry.height}, ambient));
  std::vector<std::vector<double>> along_rows(static_cast<std::size_t>(width));
  for (const double y : ys) {
    std::vector<double> row;
    for (const double x : xs) {
      VENEER_ASSIGN(const double intensity, read_spot(session, geometry, {x, y}, ambient));
      row.push_back(intensity / reference);
    }
    const CubicHermite along(xs, row, Slopes::kSmooth);
    for (int x = 0; x < width; ++x)
      along_rows[static_cast<std::size_t>(x)].push_back(along((x + 0.5) / width * geometry.width));
  }
  Image<float> map(width, height);
  for (int x = 0; x < width; ++x) {
    const CubicHermite along(ys, along_rows[static_cast<std::size_t>(x)], Slopes::kSmooth);
    for (int y = 0; y < height; ++y)
      map(x, y) = static_cast<float>(std::max(along((y + 0.5) / height * geometry.height), 1e-3));
  }
  return map;
}

}  // namespace veneer::calibration
