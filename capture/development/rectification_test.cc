// SPDX-License-Identifier: Apache-2.0
#include "capture/development/rectification.h"

#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>

#include <cmath>
#include <numbers>

#include "capture/development/testing/rendered_board.h"

namespace veneer::capture {
namespace {

using testing::BoardScene;
using testing::camera_at;
using testing::flip_local;

constexpr double kDegree = std::numbers::pi / 180;
const Eigen::Vector2d kMiddle(70, 55);  // of the default board

SampleArea middle_area() {
  return {.left_mm = 35, .top_mm = 25, .width_mm = 70, .height_mm = 60, .columns = 64, .rows = 64};
}
/// The sample hides the board's middle: a smooth texture.
double texture(const Eigen::Vector2d& mm) {
  return 0.5 + 0.2 * std::sin(mm.x() * 0.5) * std::cos(mm.y() * 0.4) + 0.002 * mm.x();
}
BoardScene covered_scene(double theta, double phi, double roll = 0) {
  BoardScene scene;
  scene.camera_from_board = camera_at(kMiddle, 800, theta, phi, roll);
  scene.cover = [](const Eigen::Vector2d& mm) {
    const SampleArea area = middle_area();
    const bool inside = mm.x() >= area.left_mm && mm.y() >= area.top_mm &&
                        mm.x() <= area.left_mm + area.width_mm &&
                        mm.y() <= area.top_mm + area.height_mm;
    return inside ? texture(mm) : -1;
  };
  return scene;
}
double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}
/// The true picture place of a point of the board.
Eigen::Vector2d true_pixel(const BoardScene& scene, const Eigen::Vector3d& mm) {
  const Eigen::Vector3d in_camera = scene.camera_from_board * (mm / 1000);
  const Eigen::Vector2d plane = in_camera.head<2>() / in_camera.z();
  const double r2 = plane.squaredNorm();
  return (plane * (1 + scene.lens.k1 * r2 + scene.lens.k2 * r2 * r2))
             .cwiseProduct(scene.lens.focal_px) +
         scene.lens.principal_point;
}
double corner_rms(const BoardScene& scene, const FoundMarks& marks) {
  double sum = 0;
  for (std::size_t i = 0; i < marks.ids.size(); ++i) {
    sum += (true_pixel(scene, {marks.board_mm[i].x(), marks.board_mm[i].y(), 0}) - marks.pixels[i])
               .squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(marks.ids.size()));
}

TEST(Board, IsDrawnAsOpenCvDrawsIt) {
  for (const auto& [columns, rows] : {std::pair{14, 11}, {5, 7}, {6, 4}, {3, 3}}) {
    const MarkBoard board{.columns = columns, .rows = rows, .square_mm = 12, .marker_mm = 9};
    const auto own = draw_board(board, 2);
    ASSERT_TRUE(own) << own.error().what;
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_100);
    cv::Mat theirs;
    cv::aruco::CharucoBoard::create(columns, rows, 12, 9, dictionary)
        ->draw({columns * 24, rows * 24}, theirs);
    ASSERT_EQ(own->width(), theirs.cols);
    int different = 0;
    for (int y = 0; y < theirs.rows; ++y)
      for (int x = 0; x < theirs.cols; ++x)
        different += (*own)(x, y) != theirs.at<std::uint8_t>(y, x) ? 1 : 0;
    EXPECT_EQ(different, 0) << columns << " x " << rows;
  }
}

TEST(Plane, IsFoundFromTheRimAtAnyTilt) {
  for (const double theta : {0.0, 20.0, 40.0, 60.0}) {
    for (const double phi : {0.0, 75.0, 200.0}) {
      const BoardScene scene = [&] {
        BoardScene s = covered_scene(theta * kDegree, phi * kDegree, 10 * kDegree);
        s.noise = 0.01;
        s.vignetting = 0.3;
        return s;
      }();
      const MergedPicture picture = render(scene);
      testing::show(picture, fmt::format("board-{}-{}", theta, phi));
      const auto marks = find_marks(picture.light, scene.board);
      ASSERT_TRUE(marks) << marks.error().what;
      const auto plane = locate_plane(*marks, scene.lens, middle_area());
      ASSERT_TRUE(plane) << plane.error().what;
      const Eigen::Vector3d eye = scene.camera_from_board.inverse().translation;
      const Eigen::Vector3d wanted =
          flip_local(eye - Eigen::Vector3d(70, 55, 0) / 1000).normalized();
      fmt::print("{} {}: {} corners, true rms {:.3f}, rms {:.3f} worst {:.3f}, view off {:.4f}\n",
                 theta,
                 phi,
                 marks->ids.size(),
                 corner_rms(scene, *marks),
                 plane->rms_px,
                 plane->worst_px,
                 angle(plane->view_direction, wanted) / kDegree);
    }
  }
}

}  // namespace
}  // namespace veneer::capture
