// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/gl_projection.h"

#include <nlohmann/json.hpp>

#include <cmath>
#include <vector>

#include "base/files.h"
#include "calibration/exchange/internal_geometry_check.h"

namespace veneer::calibration {
namespace {

/// From our axes to GL's and back: both turn by half around x.
Eigen::Matrix4d half_turn(EyeAxes axes) {
  const Eigen::Vector4d signs(1, -1, -1, 1);
  return axes == EyeAxes::kOpenGl ? Eigen::Matrix4d(signs.asDiagonal())
                                  : Eigen::Matrix4d(Eigen::Matrix4d::Identity());
}

std::vector<double> column_major(const Eigen::Matrix4d& m) {
  return {m.data(), m.data() + m.size()};
}

}  // namespace

Result<Eigen::Matrix4d> gl_projection(const ProjectorGeometry& geometry,
                                      double near_m,
                                      double far_m,
                                      EyeAxes axes) {
  if (const Status good = check_pinhole(geometry); !good)
    return fail_while("making a GL projection", good.error());
  if (!(near_m > 0 && near_m < far_m) || !std::isfinite(far_m))
    return fail(Errc::kInvalidOption,
                "making a GL projection: near {} m and far {} m; set 0 < near < far",
                near_m,
                far_m);
  const ProjectorGeometry& g = geometry;
  // For +z forward, so that w = z. x: from [0, width] to [-1, 1]; y: the same, turned over.
  const double depth = far_m - near_m;
  Eigen::Matrix4d p = Eigen::Matrix4d::Zero();
  p(0, 0) = 2 * g.fx / g.width;
  p(0, 2) = 2 * g.cx / g.width - 1;
  p(1, 1) = -2 * g.fy / g.height;
  p(1, 2) = 1 - 2 * g.cy / g.height;
  p(2, 2) = (far_m + near_m) / depth;
  p(2, 3) = -2 * far_m * near_m / depth;
  p(3, 2) = 1;
  return Eigen::Matrix4d(p * half_turn(axes));
}

Result<std::string> gl_projection_json(const ProjectorGeometry& geometry,
                                       double near_m,
                                       double far_m,
                                       EyeAxes axes) {
  VENEER_ASSIGN(const Eigen::Matrix4d projection, gl_projection(geometry, near_m, far_m, axes));
  const Eigen::Matrix4d view = half_turn(axes) * geometry.world_from_projector.inverse().matrix();
  nlohmann::json json;
  json["projection"] = column_major(projection);
  json["view"] = column_major(view);
  json["width"] = geometry.width;
  json["height"] = geometry.height;
  json["near_m"] = near_m;
  json["far_m"] = far_m;
  json["eye_axes"] = axes == EyeAxes::kOpenGl ? "-z forward, y up" : "+z forward, y down";
  return json.dump(2) + "\n";
}

Status write_gl_projection(const std::filesystem::path& path,
                           const ProjectorGeometry& geometry,
                           double near_m,
                           double far_m,
                           EyeAxes axes) {
  VENEER_ASSIGN(const std::string text, gl_projection_json(geometry, near_m, far_m, axes));
  return write_text(path, text);
}

}  // namespace veneer::calibration
