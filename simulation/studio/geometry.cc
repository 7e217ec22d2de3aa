// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/geometry.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace veneer::simulation::studio {
namespace {

// Sine of the angle to a ray below which an axis has no direction across it to speak of.
constexpr double kLeastAcross = 0.02;

Status check_directions(std::string_view name,
                        const btf::DirectionSet& directions,
                        const Eigen::Vector3d& axis) {
  if (directions.empty())
    return fail(Errc::kInvalidOption,
                "setting up the studio: the plan has no {}; give it at least one",
                name);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const btf::Direction& d = directions[i];
    // Written so that a NaN fails all.
    if (!(std::abs(d.norm() - 1) < 1e-5) || !(d.z() > 0))
      return fail(Errc::kInvalidOption,
                  "setting up the studio: number {} of the plan's {}, ({}, {}, {}), is no unit "
                  "vector above the horizon",
                  i,
                  name,
                  d.x(),
                  d.y(),
                  d.z());
    if (!(axis.cross(d).norm() > kLeastAcross))
      return fail(Errc::kInvalidOption,
                  "setting up the studio: the polarisation's axis lies along number {} of the "
                  "plan's {}, where no polariser can have it; choose another axis",
                  i,
                  name);
  }
  return {};
}

Status check_area(const capture::SampleArea& area) {
  if (!std::isfinite(area.left_mm) || !std::isfinite(area.top_mm) || !std::isfinite(area.lift_mm))
    return fail(Errc::kInvalidOption,
                "setting up the studio: the sample's left_mm, top_mm or lift_mm is no number");
  if (!(area.width_mm > 0) || !(area.height_mm > 0) || !std::isfinite(area.width_mm) ||
      !std::isfinite(area.height_mm) || area.columns < 1 || area.rows < 1)
    return fail(Errc::kInvalidOption,
                "setting up the studio: a sample of {} x {} mm and {} x {} texels is none; give "
                "numbers above 0",
                area.width_mm,
                area.height_mm,
                area.columns,
                area.rows);
  if (area.lift_mm < 0)
    return fail(Errc::kInvalidOption,
                "setting up the studio: lift_mm is {}; the sample lies on the board, so give 0 or "
                "more",
                area.lift_mm);
  const double pitch = area.width_mm / area.columns;
  if (!(std::abs(area.height_mm / area.rows - pitch) < 1e-6 * pitch))
    return fail(Errc::kInvalidOption,
                "setting up the studio: texels of {} x {} mm are not square, as the synthetic "
                "materials are; choose columns and rows in proportion to width_mm and height_mm",
                pitch,
                area.height_mm / area.rows);
  return {};
}

}  // namespace

std::optional<Eigen::Vector3d> meet_plane(const StudioGeometry::Ray& ray, double z) {
  if (!(ray.direction.z() < 0)) return std::nullopt;
  const double along = (z - ray.origin.z()) / ray.direction.z();
  if (!(along > 0)) return std::nullopt;
  return ray.origin + along * ray.direction;
}

Result<StudioGeometry> StudioGeometry::create(const StudioTruth& truth,
                                              const capture::CapturePlan& plan) {
  const Eigen::Vector3d& axis = plan.polarisation.axis;
  if (!(std::abs(axis.norm() - 1) < 1e-5))
    return fail(Errc::kInvalidOption,
                "setting up the studio: the polarisation's axis ({}, {}, {}) is no unit vector",
                axis.x(),
                axis.y(),
                axis.z());
  VENEER_TRY(check_area(plan.area));
  VENEER_TRY(check_directions("views", plan.views, axis));
  VENEER_TRY(check_directions("lights", plan.lights, axis));
  if (plan.mirror_light &&
      (*plan.mirror_light < 0 || *plan.mirror_light >= static_cast<int>(plan.lights.size())))
    return fail(Errc::kInvalidOption,
                "setting up the studio: the mirror's light is {}; the plan has 0 to {}",
                *plan.mirror_light,
                plan.lights.size() - 1);
  if (!(plan.ball_radius_mm > 0) || !std::isfinite(plan.ball_radius_mm))
    return fail(Errc::kInvalidOption,
                "setting up the studio: ball_radius_mm is {}; give a number above 0",
                plan.ball_radius_mm);
  if (!(plan.white_reflectance > 0 && plan.white_reflectance <= 1))
    return fail(Errc::kInvalidOption,
                "setting up the studio: the white target's reflectance is {}; give one above 0, at "
                "most 1",
                plan.white_reflectance);
  return StudioGeometry(truth, plan);
}

StudioGeometry::StudioGeometry(const StudioTruth& truth, const capture::CapturePlan& plan)
    : width_(truth.width),
      height_(truth.height),
      area_(plan.area),
      lens_{{truth.focal_px, truth.focal_px}, truth.principal_point, truth.k1, truth.k2},
      views_(plan.views),
      distance_mm_(truth.distance_mm),
      middle_(plan.area.left_mm + 0.5 * plan.area.width_mm,
              plan.area.top_mm + 0.5 * plan.area.height_mm),
      board_size_(Eigen::Vector2d(plan.board.columns, plan.board.rows) * plan.board.square_mm),
      light_fall_off_(truth.light_fall_off),
      vignetting_(truth.vignetting) {
  constexpr int kSide = 4;
  static_assert(kSide * kSide == kRays);
  auto place = places_.begin();
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i)
      *place++ = {(i + (j + 0.5) / kSide) / kSide, (j + (i + 0.5) / kSide) / kSide};
}

RigidTransform StudioGeometry::local_from_camera(int view) const {
  return look_at(distance_mm_ * views_[static_cast<std::size_t>(view)],
                 Eigen::Vector3d::Zero(),
                 Eigen::Vector3d::UnitY());
}

RigidTransform StudioGeometry::local_from_board() const {
  // Half a turn about x: y down and z into the board.
  return {Eigen::Quaterniond(0, 1, 0, 0), {-middle_.x(), middle_.y(), board_z()}};
}

StudioGeometry::Ray StudioGeometry::ray(const RigidTransform& local_from_camera,
                                        const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d distorted = (pixel - lens_.principal_point).cwiseQuotient(lens_.focal_px);
  const double wanted = distorted.norm();
  // Newton's steps towards the radius that the lens throws there. It rises (StudioTruth::check).
  double radius = wanted;
  for (int step = 0; step < 20; ++step) {
    const double u = radius * radius;
    const double off = radius * (1 + u * (lens_.k1 + u * lens_.k2)) - wanted;
    const double change = off / (1 + u * (3 * lens_.k1 + u * 5 * lens_.k2));
    radius -= change;
    if (std::abs(change) < 1e-14) break;
  }
  const Eigen::Vector2d slope = wanted > 0 ? (radius / wanted * distorted).eval() : distorted;
  return {local_from_camera.translation,
          local_from_camera.rotation * Eigen::Vector3d(slope.x(), slope.y(), 1).normalized()};
}

Eigen::Vector2d StudioGeometry::pixel(const RigidTransform& local_from_camera,
                                      const Eigen::Vector3d& x_in_local) const {
  const Eigen::Vector3d x_in_camera = local_from_camera.inverse() * x_in_local;
  const Eigen::Vector2d slope = x_in_camera.head<2>() / x_in_camera.z();
  const double u = slope.squaredNorm();
  return (1 + u * (lens_.k1 + u * lens_.k2)) * slope.cwiseProduct(lens_.focal_px) +
         lens_.principal_point;
}

Eigen::Vector2d StudioGeometry::board_place(const Eigen::Vector3d& x_in_local) const {
  return {middle_.x() + x_in_local.x(), middle_.y() - x_in_local.y()};
}

std::optional<std::uint32_t> StudioGeometry::texel(const Eigen::Vector3d& x_in_local) const {
  const double column =
      std::floor((x_in_local.x() + 0.5 * area_.width_mm) / area_.width_mm * area_.columns);
  const double row =
      std::floor((0.5 * area_.height_mm - x_in_local.y()) / area_.height_mm * area_.rows);
  if (!(column >= 0 && row >= 0 && column < area_.columns && row < area_.rows)) return std::nullopt;
  return static_cast<std::uint32_t>(row * area_.columns + column);
}

double StudioGeometry::fall_off(const Eigen::Vector3d& x_in_local) const {
  const double from_middle = (board_place(x_in_local) - 0.5 * board_size_).squaredNorm();
  // Beyond the board there is a table, on which it must not turn negative.
  return std::max(0.0, 1 - light_fall_off_ * from_middle / (0.25 * board_size_.squaredNorm()));
}

double StudioGeometry::vignetting(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d half(0.5 * width_, 0.5 * height_);
  return 1 - vignetting_ * (pixel - half).squaredNorm() / half.squaredNorm();
}

}  // namespace veneer::simulation::studio
