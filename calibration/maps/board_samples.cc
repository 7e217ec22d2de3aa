// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/board_samples.h"

#include <cmath>

namespace veneer::calibration {

std::vector<FallOffSample> board_samples(
    ImageView<const Rgb16> lit,
    ImageView<const Rgb16> unlit,
    ImageView<const Eigen::Vector2f> projector,
    const ProjectorGeometry& geometry,
    const RigidTransform& projector_from_board,
    const std::function<bool(const Eigen::Vector2d& point)>& is_white,
    int channel,
    int step,
    int pose) {
  VENEER_CHECK(lit.width() == unlit.width() && lit.height() == unlit.height());
  VENEER_CHECK(lit.width() == projector.width() && lit.height() == projector.height());
  VENEER_CHECK(channel >= 0 && channel < 3 && step >= 1);
  const RigidTransform board_from_projector = projector_from_board.inverse();
  const Eigen::Vector3d normal = projector_from_board.rotation * Eigen::Vector3d::UnitZ();
  const double plane = normal.dot(projector_from_board.translation);
  const auto c = static_cast<std::size_t>(channel);
  std::vector<FallOffSample> samples;
  for (int y = step / 2; y < lit.height(); y += step)
    for (int x = step / 2; x < lit.width(); x += step) {
      const Eigen::Vector2d pixel = projector(x, y).cast<double>();
      if (!pixel.allFinite()) continue;
      const Eigen::Vector3d ray(
          (pixel.x() - geometry.cx) / geometry.fx, (pixel.y() - geometry.cy) / geometry.fy, 1.0);
      const double depth = plane / normal.dot(ray);
      if (!(depth > 0 && std::isfinite(depth))) continue;
      const Eigen::Vector3d x_in_projector = depth * ray;
      if (is_white) {
        const Eigen::Vector3d point = board_from_projector * x_in_projector;
        if (!is_white(point.head<2>())) continue;
      }
      FallOffSample sample;
      sample.projector = pixel;
      sample.camera = {x + 0.5, y + 0.5};
      sample.lit = lit(x, y)[c];
      sample.unlit = unlit(x, y)[c];
      sample.x_in_projector = x_in_projector;
      sample.normal_in_projector = normal;
      sample.pose = pose;
      samples.push_back(sample);
    }
  return samples;
}

}  // namespace veneer::calibration
