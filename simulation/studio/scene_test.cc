// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/scene.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <opencv2/aruco/charuco.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "simulation/studio/testing.h"

namespace veneer::simulation::studio {
namespace {

using capture::Target;
using simulation::testing::kDegree;
using simulation::testing::small_plan;
using simulation::testing::small_truth;

StudioScene scene_of(const StudioTruth& truth, const capture::CapturePlan& plan) {
  auto geometry = StudioGeometry::create(truth, plan);
  auto board = BoardPicture::draw(plan.board);
  SilentProgress silent;
  auto sample = TracedSample::trace(truth, plan.area.columns, plan.views, plan.lights, {}, silent);
  EXPECT_TRUE(geometry && board && sample);
  return {truth, plan, *geometry, *board, *sample, plan.lights};
}

// Light is in floats.
constexpr double kFloat = 1e-5;

/// In the middle of the sample, inside a texel.
constexpr int kMiddleX = 81;
constexpr int kMiddleY = 61;

TEST(StudioScene, AWhiteTargetIsLamberts) {
  const capture::CapturePlan plan = small_plan();
  StudioScene scene = scene_of(small_truth(), plan);
  for (int light = 0; light < 3; ++light)
    for (const double angle : {0.0, 33.0, 90.0}) {
      const auto picture = scene.light({Target::kWhite, 0, light, false, angle * kDegree});
      // A perfect analyser takes half of it at any angle.
      const double wanted = 0.5 * 0.99 * plan.lights[static_cast<std::size_t>(light)].z();
      EXPECT_NEAR(picture(kMiddleX, kMiddleY).x(), wanted, kFloat) << light << ", " << angle;
      EXPECT_NEAR(picture(65, 45).z(), wanted, kFloat);
    }
}

TEST(StudioScene, AMirrorObeysMalusWithExtinctionAndMisalignment) {
  StudioTruth truth = small_truth();
  truth.light_extinction = 50;
  truth.analyser_extinction = 20;
  truth.misalignment_deg = 7;
  StudioScene scene = scene_of(truth, small_plan());
  const double of_light = (1 - 1 / 50.0) / (1 + 1 / 50.0);
  const double of_analyser = (1 - 1 / 20.0) / (1 + 1 / 20.0);
  // Half the scatter of the mirror's light, unpolarised, is added to it.
  const double scatter = StudioScene::kScatter * std::cos(10 * kDegree);
  for (const double angle : {0.0, 20.0, 45.0, 90.0, 135.0}) {
    const double contrast = of_light * of_analyser * std::cos(2 * (angle + 7) * kDegree);
    const double wanted =
        0.5 * (1 + 1 / 20.0) * (StudioScene::kMirrorStrength * (1 + contrast) + scatter);
    EXPECT_NEAR(
        scene.light({Target::kMirror, 0, 0, false, angle * kDegree})(kMiddleX, kMiddleY).y(),
        wanted,
        kFloat * StudioScene::kMirrorStrength)
        << angle;
  }
  // At another light than its own it only scatters.
  EXPECT_NEAR(scene.light({Target::kMirror, 0, 1, false, 0})(kMiddleX, kMiddleY).y(),
              0.5 * (1 + 1 / 20.0) * StudioScene::kScatter * std::cos(30 * kDegree),
              kFloat);
}

TEST(StudioScene, TexelsComeThroughAPerfectStudioAsTheyAre) {
  const capture::CapturePlan plan = small_plan();
  StudioScene scene = scene_of(small_truth(), plan);
  double specular_sum = 0;
  for (int light = 0; light < 2; ++light) {
    const auto parallel = scene.light({Target::kSample, 0, light, false, 0});
    const auto cross = scene.light({Target::kSample, 0, light, false, 90 * kDegree});
    // The light is s-polarised: it stays in its plane, and gains what Fresnel says for an incidence
    // of half the light's angle.
    const double i = 0.5 * std::acos(plan.lights[static_cast<std::size_t>(light)].z());
    const double t = std::asin(std::sin(i) / 1.5);
    const double s = std::pow(std::sin(i - t) / std::sin(i + t), 2);
    const double p = std::pow(std::tan(i - t) / std::tan(i + t), 2);
    for (int row = 0; row < 8; ++row)
      for (int column = 0; column < 8; ++column) {
        const auto texel = scene.sample().texel(0, light, column, row);
        // Each of the 16 pixels of the texel.
        for (int y = 0; y < 4; ++y)
          for (int x = 0; x < 4; ++x) {
            const Eigen::Vector3f& a = parallel(64 + 4 * column + x, 44 + 4 * row + y);
            const Eigen::Vector3f& b = cross(64 + 4 * column + x, 44 + 4 * row + y);
            const Eigen::Vector3f specular = static_cast<float>(2 * s / (s + p)) * texel.specular;
            ASSERT_NEAR((2 * b - texel.diffuse).norm(), 0, kFloat) << column << ", " << row;
            ASSERT_NEAR((a - b - specular).norm(), 0, kFloat * (1 + specular.norm()));
          }
        specular_sum += texel.specular.x();
      }
  }
  EXPECT_GT(specular_sum, 1);  // there is something to be found
}

TEST(StudioScene, CrossedPicturesAddUpButForTheAnalysersLeak) {
  StudioTruth truth = small_truth();
  truth.light_extinction = 40;
  truth.misalignment_deg = 3;
  truth.vignetting = 0.3;
  truth.light_fall_off = 0.1;
  truth.ambient = 0.05;
  truth.analyser_extinction = 1;
  // An analyser of extinction 1 is none.
  const auto all = scene_of(truth, small_plan()).light({Target::kSample, 1, 2, false, 0});
  truth.analyser_extinction = 25;
  StudioScene scene = scene_of(truth, small_plan());
  for (const double angle : {0.0, 0.4, 1.1}) {
    const auto one = scene.light({Target::kSample, 1, 2, false, angle});
    const auto other = scene.light({Target::kSample, 1, 2, false, angle + 90 * kDegree});
    for (std::size_t i = 0; i < one.pixels().size(); ++i)
      ASSERT_NEAR(
          (one.pixels()[i] + other.pixels()[i] - static_cast<float>(1 + 1 / 25.0) * all.pixels()[i])
              .norm(),
          0,
          kFloat * (1 + all.pixels()[i].norm()))
          << angle;
  }
}

TEST(StudioScene, WhatLostItsPolarisationIsTheSameAtAnyAngle) {
  StudioTruth truth = small_truth();
  truth.ambient = 0.1;
  StudioScene scene = scene_of(truth, small_plan());
  const auto first = scene.light({Target::kWhite, 1, 2, false, 0});
  for (const double angle : {0.3, 1.0, 2.2}) {
    const auto turned = scene.light({Target::kWhite, 1, 2, false, angle});
    for (std::size_t i = 0; i < first.pixels().size(); ++i)
      ASSERT_NEAR((first.pixels()[i] - turned.pixels()[i]).norm(), 0, kFloat) << angle;
  }
}

TEST(StudioScene, InTheDarkOnlyTheRoomIsSeen) {
  StudioTruth truth = small_truth();
  truth.ambient = 0.2;
  truth.light_fall_off = 0.3;  // which is the projector's, not the room's
  StudioScene scene = scene_of(truth, small_plan());
  const auto white = scene.light({Target::kWhite, 0, 0, true, 0});
  EXPECT_NEAR(white(kMiddleX, kMiddleY).x(), 0.5 * 0.2 * 0.99, kFloat);
  EXPECT_NEAR(white(65, 45).x(), 0.5 * 0.2 * 0.99, kFloat);
  // The board's first square is ink.
  EXPECT_NEAR(white(18, 10).x(), 0.5 * 0.2 * BoardPicture::kBlack, kFloat);
  // A texel sends of it what it sends of all lights together.
  const auto lit = scene.light({Target::kSample, 0, 0, true, 0});
  Rgb32f sum = Rgb32f::Zero();
  double cosines = 0;
  for (int light = 0; light < 3; ++light) {
    const auto texel = scene.sample().texel(0, light, 4, 4);
    sum += texel.specular + texel.diffuse;
    cosines += small_plan().lights[static_cast<std::size_t>(light)].z();
  }
  EXPECT_NEAR(lit(kMiddleX, kMiddleY).x(), 0.5 * 0.2 * sum.x() / cosines, kFloat);
  truth.ambient = 0;
  StudioScene black = scene_of(truth, small_plan());
  for (const Target target : {Target::kSample, Target::kMirror, Target::kMirrorBall}) {
    const auto picture = black.light({target, 0, 0, true, 0});
    for (const Rgb32f& pixel : picture.pixels()) ASSERT_EQ(pixel.norm(), 0);
  }
}

TEST(StudioScene, TheLampDriftsBeforeTheSecondPicture) {
  StudioTruth truth = small_truth();
  truth.polarised_gain = 0.9;
  truth.irradiance = 3;
  StudioScene scene = scene_of(truth, small_plan());
  const auto parallel = scene.light({Target::kWhite, 0, 0, false, 0});
  const auto cross = scene.light({Target::kWhite, 0, 0, false, 90 * kDegree});
  EXPECT_NEAR(parallel(kMiddleX, kMiddleY).x(), 3 * 0.5 * 0.99 * std::cos(10 * kDegree), kFloat);
  EXPECT_NEAR(cross(kMiddleX, kMiddleY).x() / parallel(kMiddleX, kMiddleY).x(), 0.9, kFloat);
}

TEST(StudioScene, PixelsOfAMosaicAreBehindTheirOwnAnalysers) {
  StudioTruth truth = small_truth();
  truth.light_extinction = 30;
  truth.analyser_extinction = 60;
  truth.misalignment_deg = 2;
  StudioScene turned = scene_of(truth, small_plan());
  truth.mosaic = true;
  StudioScene mosaic = scene_of(truth, small_plan());
  for (const Target target : {Target::kSample, Target::kMirror}) {
    const auto raw = mosaic.light({target, 0, 0, false, 0});
    // Rows of the sensor's cells.
    const double angles[2][2] = {{90, 45}, {135, 0}};
    for (int row = 0; row < 2; ++row)
      for (int column = 0; column < 2; ++column) {
        const auto whole = turned.light({target, 0, 0, false, angles[row][column] * kDegree});
        for (int y = row; y < 120; y += 2)
          for (int x = column; x < 160; x += 2) {
            const Rgb32f& seen = whole(x, y);
            const double luminance = 0.2126 * seen.x() + 0.7152 * seen.y() + 0.0722 * seen.z();
            ASSERT_NEAR(raw(x, y).x(), luminance, kFloat * (1 + luminance)) << x << ", " << y;
            ASSERT_EQ(raw(x, y).x(), raw(x, y).z());
          }
      }
  }
}

TEST(StudioScene, APixelIsTheMeanOfWhatItCovers) {
  // Texels of 2.5 pixels, the sample's edges in the middle of pixels.
  StudioTruth truth = small_truth();
  truth.focal_px = 1000;
  truth.principal_point = {80.5, 60.5};
  StudioScene scene = scene_of(truth, small_plan());
  const auto cross = scene.light({Target::kSample, 0, 0, false, 90 * kDegree});
  const auto diffuse = [&](int column) {
    return scene.sample().texel(0, 0, column, 4).diffuse.x();
  };
  // Two texels are five pixels; the last of them has a half of the texel after.
  for (int column = 0; column < 6; column += 2) {
    const int x = 71 + 5 * column / 2;
    EXPECT_NEAR(2 * cross(x, 61).x(), diffuse(column), kFloat) << column;
    EXPECT_NEAR(2 * cross(x + 1, 61).x(), diffuse(column), kFloat) << column;
    EXPECT_NEAR(2 * cross(x + 3, 61).x(), diffuse(column + 1), kFloat) << column;
    EXPECT_NEAR(2 * cross(x + 4, 61).x(), 0.5 * (diffuse(column + 1) + diffuse(column + 2)), kFloat)
        << column;
  }
}

/// Middle of what is brighter than a tenth of the brightest, weighted.
Eigen::Vector2d brightest(const Image<Rgb32f>& picture) {
  float most = 0;
  for (const Rgb32f& pixel : picture.pixels()) most = std::max(most, pixel.y());
  Eigen::Vector2d sum(0, 0);
  double weight = 0;
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x)
      if (const float light = picture(x, y).y(); light > 0.1F * most) {
        sum += light * Eigen::Vector2d(x + 0.5, y + 0.5);
        weight += light;
      }
  return sum / weight;
}

TEST(StudioScene, ABallsHighlightIsWhereItsNormalHalvesLightAndView) {
  StudioTruth truth = small_truth();
  truth.focal_px = 6400;
  truth.k1 = 0.3;
  const capture::CapturePlan plan = small_plan();
  StudioScene scene = scene_of(truth, plan);
  for (int view = 0; view < 2; ++view)
    for (int light = 0; light < 3; ++light) {
      const RigidTransform pose = scene.geometry().local_from_camera(view);
      const Eigen::Vector3d to_light = plan.lights[static_cast<std::size_t>(light)];
      const Eigen::Vector3d centre(0, 0, plan.ball_radius_mm);
      // Towards the camera from the place itself, which is found by going round.
      Eigen::Vector3d place = centre;
      for (int round = 0; round < 20; ++round) {
        const Eigen::Vector3d to_camera = (pose.translation - place).normalized();
        place = centre + plan.ball_radius_mm * (to_camera + to_light).normalized();
      }
      const auto picture = scene.light({Target::kMirrorBall, view, light, false, 0});
      const Eigen::Vector2d seen = brightest(picture);
      const Eigen::Vector2d wanted = scene.geometry().pixel(pose, place);
      EXPECT_NEAR((seen - wanted).norm(), 0, 0.3)
          << "view " << view << ", light " << light << ": " << seen.transpose() << " for "
          << wanted.transpose();
    }
}

TEST(StudioScene, OpenCvFindsTheMarksWhereTheyAre) {
  StudioTruth truth = small_truth();
  truth.width = 640;
  truth.height = 480;
  truth.focal_px = 6200;
  truth.principal_point = {317, 244};
  truth.k1 = 1;
  truth.vignetting = 0.3;
  const capture::CapturePlan plan = small_plan();
  StudioScene scene = scene_of(truth, plan);
  for (int view = 0; view < 2; ++view) {
    const auto light = scene.light({Target::kSample, view, 1, false, 0});
    cv::Mat picture(480, 640, CV_8U);
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x)
        picture.at<std::uint8_t>(y, x) =
            static_cast<std::uint8_t>(std::min(255.0F, 255 * 2 * light(x, y).y()));
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_100);
    const auto board = cv::aruco::CharucoBoard::create(11, 9, 6, 4.2F, dictionary);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> marker_ids;
    cv::aruco::detectMarkers(picture, dictionary, markers, marker_ids);
    std::vector<cv::Point2f> corners;
    std::vector<int> ids;
    cv::aruco::interpolateCornersCharuco(markers, marker_ids, picture, board, corners, ids);
    // The sample of 16 mm hides 4 x 4 of the 10 x 8 corners at most, and spoils some around.
    EXPECT_GE(ids.size(), 44U);
    double worst = 0;
    Eigen::Vector2d mean(0, 0);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const cv::Point3f place = board->chessboardCorners[static_cast<std::size_t>(ids[i])];
      const Eigen::Vector2d wanted = scene.geometry().pixel(
          scene.geometry().local_from_camera(view),
          scene.geometry().local_from_board() * Eigen::Vector3d(place.x, place.y, 0));
      // Unlike cornerSubPix(), this search has the first pixel's centre at (0.5, 0.5).
      const Eigen::Vector2d off = Eigen::Vector2d(corners[i].x, corners[i].y) - wanted;
      worst = std::max(worst, off.norm());
      mean += off / static_cast<double>(ids.size());
    }
    // Edges as sharp as pixels draw the search to the pixels' middles, each corner to its own side.
    EXPECT_LT(worst, 0.3) << "view " << view;
    // What is left of that in the mean of 64 corners; half a pixel would be 0.7.
    EXPECT_LT(mean.norm(), 0.06) << "view " << view;
  }
}

}  // namespace
}  // namespace veneer::simulation::studio
