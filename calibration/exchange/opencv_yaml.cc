// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/opencv_yaml.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/files.h"
#include "calibration/exchange/internal_geometry_check.h"

namespace veneer::calibration {
namespace {

/// OpenCV counts pixels from the centre of the first, we from its corner.
constexpr double kPixelCentre = 0.5;

/// @param values  row by row.
std::string matrix(std::string_view name, int rows, int columns, std::span<const double> values) {
  std::string data;
  for (const double value : values)
    data += fmt::format("{}{:.17g}", data.empty() ? "" : ", ", value);
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n",
                     name,
                     rows,
                     columns,
                     data);
}

}  // namespace

Result<std::string> opencv_yaml(const ProjectorGeometry& geometry,
                                const std::vector<double>& distortion) {
  if (const Status good = check_pinhole(geometry); !good)
    return fail_while("writing the geometry for OpenCV", good.error());
  constexpr std::array<std::size_t, 6> kCounts{0, 4, 5, 8, 12, 14};
  if (std::ranges::find(kCounts, distortion.size()) == kCounts.end() ||
      !std::ranges::all_of(distortion, [](double k) { return std::isfinite(k); }))
    return fail(Errc::kBadFormat,
                "writing the geometry for OpenCV: there are {} coefficients of distortion, or one "
                "is not finite; OpenCV takes 0, 4, 5, 8, 12 or 14",
                distortion.size());
  const ProjectorGeometry& g = geometry;
  const std::array<double, 9> camera{
      g.fx, 0, g.cx - kPixelCentre, 0, g.fy, g.cy - kPixelCentre, 0, 0, 1};
  const RigidTransform projector_from_world = g.world_from_projector.inverse();
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation =
      projector_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d& translation = projector_from_world.translation;
  const std::vector<double> coefficients =
      distortion.empty() ? std::vector<double>(5, 0.0) : distortion;
  std::string text = "%YAML:1.0\n---\n";
  text += fmt::format("image_width: {}\nimage_height: {}\n", g.width, g.height);
  text += matrix("camera_matrix", 3, 3, camera);
  text += matrix("distortion_coefficients", 1, static_cast<int>(coefficients.size()), coefficients);
  text += matrix("R", 3, 3, {rotation.data(), 9});
  text += matrix("T", 3, 1, {translation.data(), 3});
  return text;
}

Status write_opencv_yaml(const std::filesystem::path& path,
                         const ProjectorGeometry& geometry,
                         const std::vector<double>& distortion) {
  VENEER_ASSIGN(const std::string text, opencv_yaml(geometry, distortion));
  return write_text(path, text);
}

}  // namespace veneer::calibration
