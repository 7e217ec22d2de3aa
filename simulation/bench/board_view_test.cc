// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/board_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;
using testing::truth_with_camera;

std::vector<RigidTransform> poses_of(const BenchTruth& truth) {
  auto poses = board_poses(*truth.board, *truth.camera, truth.projector);
  EXPECT_TRUE(poses) << poses.error().what;
  return poses ? *poses : std::vector<RigidTransform>{};
}

/// The raster all of one light.
Image<Rgb32f> even_raster(const BenchTruth& truth, float light) {
  return {truth.projector.width, truth.projector.height, Rgb32f::Constant(light)};
}

TEST(RadialDistortion, ComesBack) {
  for (const auto& [k1, k2] : {std::pair{0.0, 0.0}, {-0.2, 0.1}, {0.4, -0.1}, {-0.5, 0.9}}) {
    const RadialDistortion lens(k1, k2, 0.4);
    Pcg32 random(3);
    for (int trial = 0; trial < 1000; ++trial) {
      const double angle = 2 * std::numbers::pi * random.uniform();
      const Eigen::Vector2d slope =
          0.4 * random.uniform() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      // A thousandth of a pixel is 1e-6 at any sensible focal length.
      EXPECT_LE((lens.undistorted(lens.distorted(slope)) - slope).norm(), 1e-8)
          << k1 << ' ' << k2 << ' ' << slope.transpose();
    }
    EXPECT_TRUE(lens.undistorted({0, 0}).isZero());
    EXPECT_TRUE(lens.undistorted({1e3, 0}).allFinite()) << "beyond the table";
  }
}

TEST(BoardReflectance, IsAChequerboardWithinAWhiteBorder) {
  const BoardTruth board = *truth_with_camera().board;
  const double square = board.square_m;
  const auto at = [&](double column, double row) {
    return board_reflectance(board, {column * square, row * square});
  };
  EXPECT_EQ(at(-0.5, -0.5), board.black) << "the first square";
  EXPECT_EQ(at(0.5, -0.5), board.white);
  for (int row = -1; row < board.rows; ++row)
    for (int column = -1; column < board.columns - 1; ++column)
      EXPECT_NE(at(column + 0.5, row + 0.5), at(column + 1.5, row + 0.5)) << column << ' ' << row;
  EXPECT_EQ(board_reflectance(board, {-square - 0.004, 0}), board.white) << "the border";
  EXPECT_EQ(board_reflectance(board, {-square - 0.006, 0}), 0) << "past it";
  EXPECT_EQ(board_reflectance(board, {0, board.rows * square + 0.006}), 0);
  EXPECT_EQ(board_reflectance(board, {std::nan(""), 0}), 0);
}

TEST(BoardReflectance, AveragedIsWhatManyPointsHaveOnAverage) {
  const BoardTruth board = *truth_with_camera().board;
  Pcg32 random(7);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector2d middle(0.05 * random.uniform(), 0.03 * random.uniform());
    const Eigen::Vector2d width(0.02 * random.uniform(), 0.005 * random.uniform());
    double mean = 0;
    constexpr int kPoints = 200;
    for (int i = 0; i < kPoints; ++i)
      for (int j = 0; j < kPoints; ++j) {
        const Eigen::Vector2d part((i + 0.5) / kPoints - 0.5, (j + 0.5) / kPoints - 0.5);
        mean += board_reflectance(board, middle + part.cwiseProduct(width)) / (kPoints * kPoints);
      }
    // An edge is met by one of 200 columns or rows too many or too few.
    EXPECT_NEAR(board_reflectance(board, middle, width), mean, 1.5 * 0.8 / kPoints)
        << middle.transpose() << " over " << width.transpose();
  }
}

TEST(BoardPoses, AreTiltedAllAroundAndSeenByBoth) {
  const BenchTruth truth = truth_with_camera();
  const std::vector<RigidTransform> poses = poses_of(truth);
  ASSERT_EQ(poses.size(), 8U);
  const VirtualProjector projector(truth.projector);
  Eigen::Vector3d mean_normal = Eigen::Vector3d::Zero();
  for (const RigidTransform& world_from_board : poses) {
    const Eigen::Vector3d normal = world_from_board.rotation * -Eigen::Vector3d::UnitZ();
    mean_normal += normal / 8;
    for (int row = -1; row <= truth.board->rows; ++row)
      for (int column = -1; column <= truth.board->columns; ++column) {
        const Eigen::Vector3d corner = world_from_board * board_corner(*truth.board, column, row);
        EXPECT_TRUE(projector.pixel_of(corner));
        const Eigen::Vector2d seen = camera_pixel(*truth.camera, corner);
        EXPECT_TRUE(seen.minCoeff() > 0 && seen.x() < 320 && seen.y() < 240) << seen.transpose();
        EXPECT_GT(normal.dot(truth.projector.world_from_projector.translation - corner), 0);
        EXPECT_GT(normal.dot(truth.camera->world_from_camera.translation - corner), 0);
      }
  }
  // Each is at least three quarters of the tilt from their mean, less what the ring is uneven.
  for (const RigidTransform& pose : poses) {
    const double cosine = (pose.rotation * -Eigen::Vector3d::UnitZ()).dot(mean_normal.normalized());
    const double degrees = std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi;
    EXPECT_GT(degrees, 0.5 * truth.board->tilt_deg);
  }
  const std::vector<RigidTransform> again = poses_of(truth);
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_EQ(again[i].matrix(), poses[i].matrix()) << "the same for the same seed";
}

TEST(BoardPoses, ABoardThatDoesNotFitIsRefused) {
  BenchTruth truth = truth_with_camera();
  truth.board->square_m = 0.1;
  const auto poses = board_poses(*truth.board, *truth.camera, truth.projector);
  ASSERT_FALSE(poses);
  EXPECT_THAT(poses.error().what, HasSubstr("smaller"));
}

TEST(BoardView, SendsWhatSlantDistanceAndVignettingLeave) {
  BenchTruth truth = truth_with_camera();
  truth.projector.vignetting_exponent = 4;
  truth.projector.vignetting_drop = 0.3;
  truth.board->black = truth.board->white;  // an even board
  const VirtualProjector projector(truth.projector);
  const RigidTransform pose = poses_of(truth).front();
  const BoardView view(*truth.board, *truth.camera, projector, truth.projector, pose);
  const Image<Rgb32f> picture = view.gather(even_raster(truth, 7), 0.5F, Rgb32f::Constant(0.25F));
  for (int row = 0; row < truth.board->rows; ++row)
    for (int column = 0; column < truth.board->columns; ++column) {
      const Eigen::Vector3d x = pose * board_corner(*truth.board, column, row);
      const Eigen::Vector3d to_lens = truth.projector.world_from_projector.translation - x;
      const Eigen::Vector3d normal = pose.rotation * -Eigen::Vector3d::UnitZ();
      const double geometry = normal.dot(to_lens.normalized()) / to_lens.squaredNorm() *
                              projector.vignetting(*projector.pixel_of(x));
      const Eigen::Vector2d at = camera_pixel(*truth.camera, x);
      const Rgb32f seen = picture(static_cast<int>(at.x()), static_cast<int>(at.y()));
      // G varies by some thousandths over the half pixel from the corner to the pixel's middle.
      EXPECT_NEAR(seen.x(), 0.85 * (0.5 * 7 * geometry + 0.25), 5e-3 * seen.x())
          << column << ' ' << row;
    }
  EXPECT_TRUE(picture(0, 0).isZero()) << "past the board";
}

/// Where the edges around a place meet: the point to which all gradients of the neighbourhood are
/// square, by least squares (Foerstner and Guelch 1987).
Eigen::Vector2d saddle_near(const Image<Rgb32f>& picture, Eigen::Vector2d at) {
  constexpr int kReach = 8;
  for (int pass = 0; pass < 5; ++pass) {
    Eigen::Matrix2d a = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    const int x0 = static_cast<int>(at.x());
    const int y0 = static_cast<int>(at.y());
    for (int y = y0 - kReach; y <= y0 + kReach; ++y)
      for (int x = x0 - kReach; x <= x0 + kReach; ++x) {
        const Eigen::Vector2d gradient(picture(x + 1, y).x() - picture(x - 1, y).x(),
                                       picture(x, y + 1).x() - picture(x, y - 1).x());
        const Eigen::Vector2d place(x + 0.5, y + 0.5);
        const double weight = std::exp(-(place - at).squaredNorm() / (0.5 * kReach * kReach));
        a += weight * gradient * gradient.transpose();
        b += weight * gradient * gradient.dot(place);
      }
    at = a.inverse() * b;
  }
  return at;
}

TEST(BoardView, ShowsTheCornersWherePinholeAndDistortionSay) {
  BenchTruth truth = truth_with_camera();
  truth.camera->samples = 8;  // so that what is tested is the place, not the grain of the rays
  truth.camera->width = 640;
  truth.camera->height = 480;
  truth.camera->focal_px = 1800;
  truth.camera->principal_point = {326, 236};
  truth.camera->k1 = -0.6;  // moves the outer corners by more than a pixel
  const VirtualProjector projector(truth.projector);
  std::vector<RigidTransform> poses = poses_of(truth);
  poses.resize(3);  // each takes a while with so many rays
  for (const RigidTransform& pose : poses) {
    const BoardView view(*truth.board, *truth.camera, projector, truth.projector, pose);
    const Image<Rgb32f> picture = view.gather(even_raster(truth, 1), 1, Rgb32f::Zero());
    for (int row = 0; row < truth.board->rows; ++row)
      for (int column = 0; column < truth.board->columns; ++column) {
        const Eigen::Vector2d expected =
            camera_pixel(*truth.camera, pose * board_corner(*truth.board, column, row));
        const Eigen::Vector2d found = saddle_near(picture, expected + Eigen::Vector2d(0.4, -0.3));
        EXPECT_LE((found - expected).norm(), 0.05)
            << column << ' ' << row << ": " << found.transpose() << " for " << expected.transpose();
      }
  }
}

TEST(BoardView, ARasterPixelLightsItsOwnPlaceAlone) {
  const BenchTruth truth = truth_with_camera();
  const VirtualProjector projector(truth.projector);
  const RigidTransform pose = poses_of(truth)[2];
  const BoardView view(*truth.board, *truth.camera, projector, truth.projector, pose);
  // The middle of the board, and the raster pixel that lights it.
  const Eigen::Vector3d x = pose * Eigen::Vector3d(0.03, 0.0225, 0);
  const Eigen::Vector2d raster = *projector.pixel_of(x);
  Image<Rgb32f> light = even_raster(truth, 0);
  light(static_cast<int>(raster.x()), static_cast<int>(raster.y())) = Rgb32f::Ones();
  const Image<Rgb32f> picture = view.gather(light, 1, Rgb32f::Zero());
  const Eigen::Vector2d at = camera_pixel(*truth.camera, x);
  Eigen::Vector2d least = at;
  Eigen::Vector2d most = at;
  for (int py = 0; py < 240; ++py)
    for (int px = 0; px < 320; ++px) {
      if (picture(px, py).isZero()) continue;
      least = least.cwiseMin(Eigen::Vector2d(px, py));
      most = most.cwiseMax(Eigen::Vector2d(px + 1, py + 1));
    }
  EXPECT_GT(picture(static_cast<int>(at.x()), static_cast<int>(at.y())).x(), 0);
  // A raster pixel is 1/320 m at 1 m, a camera pixel 1/900: about 3 by 3, at a slant up to 5.
  EXPECT_LE((most - least).maxCoeff(), 6) << least.transpose() << " to " << most.transpose();
}

}  // namespace
}  // namespace veneer::simulation
