// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/opencv_yaml.h"

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include <cmath>

#include "base/testing/temporary_folder.h"
#include "calibration/internal_profile_testing.h"

// Read back with OpenCV itself, which the module does without.
namespace veneer::calibration {
namespace {

TEST(OpencvYaml, OpencvProjectsAPointOfTheWorldToOurPixel) {
  const ProjectorGeometry g = example_geometry();
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "projector.yml").string();
  ASSERT_TRUE(write_opencv_yaml(path, g));
  const cv::FileStorage file(path, cv::FileStorage::READ);
  ASSERT_TRUE(file.isOpened());
  cv::Mat camera;
  cv::Mat distortion;
  cv::Mat rotation;
  cv::Mat translation;
  file["camera_matrix"] >> camera;
  file["distortion_coefficients"] >> distortion;
  file["R"] >> rotation;
  file["T"] >> translation;
  EXPECT_EQ(static_cast<int>(file["image_width"]), g.width);
  EXPECT_EQ(static_cast<int>(file["image_height"]), g.height);
  EXPECT_EQ(distortion.total(), 5U);
  const Eigen::Vector3d in_projector(0.2, -0.3, 1.5);
  const Eigen::Vector3d in_world = g.world_from_projector * in_projector;
  cv::Mat vector;
  cv::Rodrigues(rotation, vector);
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(std::vector<cv::Point3d>{{in_world.x(), in_world.y(), in_world.z()}},
                    vector,
                    translation,
                    camera,
                    distortion,
                    pixels);
  constexpr double kPixelTolerance = 1e-9;  // double precision over a raster of a thousand
  ASSERT_EQ(pixels.size(), 1U);
  // OpenCV counts from the centre of the first pixel, we from its corner.
  EXPECT_NEAR(pixels[0].x + 0.5, g.fx * 0.2 / 1.5 + g.cx, kPixelTolerance);
  EXPECT_NEAR(pixels[0].y + 0.5, g.fy * -0.3 / 1.5 + g.cy, kPixelTolerance);
}

TEST(OpencvYaml, CoefficientsComeBackBitByBit) {
  const std::vector<double> distortion{0.1, -1e-17, 1.0 / 3, 0, 2};
  const auto text = opencv_yaml(example_geometry(), distortion);
  ASSERT_TRUE(text);
  const cv::FileStorage file(*text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
  cv::Mat read;
  file["distortion_coefficients"] >> read;
  ASSERT_EQ(read.total(), distortion.size());
  for (int i = 0; i < 5; ++i)
    EXPECT_DOUBLE_EQ(read.at<double>(i), distortion[static_cast<std::size_t>(i)]) << i;
}

TEST(OpencvYaml, WhatOpencvWouldNotTakeIsRefused) {
  EXPECT_FALSE(opencv_yaml(example_geometry(), {1}));
  EXPECT_FALSE(opencv_yaml(example_geometry(), {0, 0, std::nan(""), 0}));
  ProjectorGeometry g = example_geometry();
  g.fy = -1;
  EXPECT_FALSE(opencv_yaml(g));
  g = example_geometry();
  g.world_from_projector.rotation.coeffs().setZero();
  EXPECT_FALSE(opencv_yaml(g));
  g = example_geometry();
  g.world_from_projector.translation.x() = INFINITY;
  EXPECT_FALSE(opencv_yaml(g));
}

}  // namespace
}  // namespace veneer::calibration
