// SPDX-License-Identifier: Apache-2.0
#include "capture/development/mirror_ball.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "capture/development/testing/rendered_board.h"

namespace veneer::capture {
namespace {

using testing::BoardScene;
using testing::camera_at;
using testing::flip_local;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kLamp = 2.5 * kDegree;  // half its angle
constexpr double kRadiusMm = 15;
const Eigen::Vector3d kBall(72.3, 53.6, -kRadiusMm);  // board, millimetres

Eigen::Vector3d direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}
double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}
/// Way to the ball along a ray.
std::optional<double> way_to_ball(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d to = kBall - from;
  const double along = to.dot(ray);
  const double root = along * along - to.squaredNorm() + kRadiusMm * kRadiusMm;
  if (root <= 0 || along <= 0) return std::nullopt;
  return along - std::sqrt(root);
}

/// A ball of polished steel on the board: it mirrors the board, a dark room and a lamp of 5
/// degrees, and casts a shadow.
BoardScene ball_scene(const Eigen::Vector3d& light_local, double view_theta, double view_phi) {
  BoardScene scene;
  scene.camera_from_board = camera_at({70, 55}, 800, view_theta, view_phi, 0.1);
  const Eigen::Vector3d light = flip_local(light_local);
  const auto drawn = std::make_shared<Image<std::uint8_t>>(draw_board(scene.board, 10).value());
  scene.cover = [light](const Eigen::Vector2d& mm) {
    return way_to_ball({mm.x(), mm.y(), 0}, light) ? 0.02 : -1.0;
  };
  scene.in_front = [light, drawn](const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    const auto way = way_to_ball(eye, ray);
    if (!way) return -1.0;
    const Eigen::Vector3d point = eye + *way * ray;
    const Eigen::Vector3d normal = (point - kBall) / kRadiusMm;
    const Eigen::Vector3d mirrored = ray - 2 * ray.dot(normal) * normal;
    if (angle(mirrored, light) < kLamp) return 400.0;
    if (!(mirrored.z() > 0)) return 0.03;
    const Eigen::Vector3d hit = point - point.z() / mirrored.z() * mirrored;
    if (way_to_ball({hit.x(), hit.y(), 0}, light)) return 0.01;
    const int x = static_cast<int>(std::floor(hit.x() * 10));
    const int y = static_cast<int>(std::floor(hit.y() * 10));
    if (x < 0 || y < 0 || x >= drawn->width() || y >= drawn->height()) return 0.05;
    return (*drawn)(x, y) > 0 ? 0.5 : 0.02;
  };
  scene.noise = 0.005;
  scene.samples = 6;
  return scene;
}
PlaneView plane_of(const BoardScene& scene) {
  PlaneView plane;
  plane.lens = scene.lens;
  plane.camera_from_board = scene.camera_from_board;
  return plane;
}

TEST(MirrorBall, TellsTheDirectionOfTheLight) {
  for (const auto& [theta, phi, view_theta, view_phi] : {std::array{5.0, 40.0, 0.0, 0.0},

                                                         {60.0, 250.0, 0.0, 0.0},
                                                         {60.0, 10.0, 0.0, 0.0},
                                                         {20.0, 300.0, 35.0, 0.0},
                                                         {50.0, 180.0, 35.0, 60.0}}) {
    const Eigen::Vector3d light = direction(theta * kDegree, phi * kDegree);
    const BoardScene scene = ball_scene(light, view_theta * kDegree, view_phi * kDegree);
    const MergedPicture picture = render(scene);
    testing::show(picture, fmt::format("ball-{}-{}-{}", theta, phi, view_theta));
    const auto reading = read_mirror_ball(picture, plane_of(scene), kRadiusMm);
    ASSERT_TRUE(reading) << reading.error().what;
    const Eigen::Vector3d centre = scene.camera_from_board * (kBall / 1000);
    const Eigen::Vector2d centre_px =
        (centre.head<2>() / centre.z()).cwiseProduct(scene.lens.focal_px) +
        scene.lens.principal_point;
    EXPECT_LT((reading->centre_px - centre_px).norm(), 0.3);
    EXPECT_LT(angle(reading->light, light), 0.5 * kDegree) << theta << " " << phi;
    EXPECT_GT(reading->deviation_rad, 0);
  }
}

TEST(MirrorBall, RefusesWhatIsNone) {
  BoardScene scene = ball_scene(direction(0.5, 1), 0, 0);
  scene.samples = 2;
  const MergedPicture picture = render(scene);
  const PlaneView plane = plane_of(scene);
  for (const double radius : {0.0, -1.0, std::nan(""), 0.5})
    EXPECT_EQ(read_mirror_ball(picture, plane, radius).error().code, Errc::kNotFound) << radius;
  EXPECT_EQ(read_mirror_ball({}, plane, kRadiusMm).error().code, Errc::kNotFound);
  EXPECT_EQ(read_mirror_ball(picture, {}, kRadiusMm).error().code, Errc::kInvalidOption);
  // Without a highlight; and with one that is on no ball.
  scene.in_front = [](const auto&, const auto&) { return -1.0; };
  EXPECT_EQ(read_mirror_ball(render(scene), plane, kRadiusMm).error().code, Errc::kNotFound);
  scene.cover = [](const Eigen::Vector2d& mm) {
    return (mm - Eigen::Vector2d(70, 50)).norm() < 0.5 ? 400.0 : 0.3;
  };
  EXPECT_EQ(read_mirror_ball(render(scene), plane, kRadiusMm).error().code, Errc::kNotFound);
}

}  // namespace
}  // namespace veneer::capture
