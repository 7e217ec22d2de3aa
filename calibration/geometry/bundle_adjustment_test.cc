// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "base/files.h"
#include "base/image_files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::geometry {
namespace {

const Board kBoard{9, 7, 0.03};
const Rig kTruth{
    {1800, 1790, 650, 500, -0.2, 0.1},
    {2400, 2410, 900, 1300, -0.05, 0.02},  // shifted upwards, as projectors are
    {Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.3, -0.9, 0.1).normalized())),
     {0.25, 0.2, 0.05}}};

GeometryOptions options_for() {
  GeometryOptions options;
  options.camera_width = 1280;
  options.camera_height = 1024;
  options.projector_width = 1920;
  options.projector_height = 1080;
  return options;
}

RigidTransform tilted(double about_x, double about_y, double distance) {
  RigidTransform pose;
  pose.rotation = Eigen::AngleAxisd(about_x, Eigen::Vector3d::UnitX()) *
                  Eigen::AngleAxisd(about_y, Eigen::Vector3d::UnitY());
  pose.translation = pose.rotation * Eigen::Vector3d(-0.12, -0.09, 0) +
                     Eigen::Vector3d(0.02 * about_y, 0.02 * about_x, distance);
  return pose;
}

View view_of(const RigidTransform& camera_from_board, double noise, std::uint64_t seed) {
  Pcg32 random(seed);
  View view;
  view.name = fmt::format("pose {}", seed);
  view.x_in_object = kBoard.corners();
  for (const Eigen::Vector3d& x : view.x_in_object) {
    const Eigen::Vector3d in_camera = camera_from_board * x;
    const auto shaken = [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
      return pixel + noise * Eigen::Vector2d(random.normal(), random.normal());
    };
    view.camera.push_back(shaken(kTruth.camera.project(in_camera)));
    view.projector.push_back(
        shaken(kTruth.projector.project(kTruth.projector_from_camera * in_camera)));
  }
  return view;
}

std::vector<View> views_of(double noise) {
  std::vector<View> views;
  const double tilts[6][3] = {{0.5, 0.1, 0.7},
                              {-0.5, 0.1, 0.8},
                              {0.1, 0.6, 0.75},
                              {0, -0.6, 0.9},
                              {0.4, 0.4, 0.6},
                              {-0.3, -0.4, 0.7}};
  std::uint64_t seed = 1;
  for (const auto& t : tilts) views.push_back(view_of(tilted(t[0], t[1], t[2]), noise, seed++));
  return views;
}

TEST(Calibration, RecoversTheTruthFromExactPoints) {
  SilentProgress progress;
  const auto result = calibrate_geometry(views_of(0), options_for(), progress);
  ASSERT_TRUE(result) << result.error().what;
  constexpr double kPixels = 1e-4;  // of principal points, which are the worst held
  EXPECT_NEAR(result->camera.fx, kTruth.camera.fx, kPixels);
  EXPECT_NEAR(result->camera.cy, kTruth.camera.cy, kPixels);
  EXPECT_NEAR(result->camera.k1, kTruth.camera.k1, 1e-6);
  EXPECT_NEAR(result->projector.fy, kTruth.projector.fy, kPixels);
  EXPECT_NEAR(result->projector.cy, kTruth.projector.cy, kPixels);
  EXPECT_NEAR(result->projector.k2, kTruth.projector.k2, 1e-5);
  EXPECT_LT(
      (result->projector_from_camera.translation - kTruth.projector_from_camera.translation).norm(),
      1e-7);
  EXPECT_LT(result->stereo_rms_px, 1e-6);
  EXPECT_LT(result->held_out_projector_rms_px, 1e-4);
  EXPECT_EQ(result->starts.size(), 5U);
  EXPECT_LT(result->start_disagreement, 1e-6);
}

TEST(Calibration, KnowsItsOwnErrorsAndAgreesFromAllStarts) {
  constexpr double kNoise = 0.3;
  SilentProgress progress;
  const auto result = calibrate_geometry(views_of(kNoise), options_for(), progress);
  ASSERT_TRUE(result) << result.error().what;
  // Distances have two coordinates; 1512 residuals less 54 unknowns; 5 % is two deviations and
  // more.
  EXPECT_NEAR(result->stereo_rms_px, kNoise * std::sqrt(2 * (1 - 54.0 / 1512)), 0.05 * kNoise * 2);
  EXPECT_LT(std::abs(result->projector.fx - kTruth.projector.fx),
            4 * result->projector_deviations.fx);
  EXPECT_LT(std::abs(result->camera.fx - kTruth.camera.fx), 4 * result->camera_deviations.fx);
  for (int i = 0; i < 3; ++i)
    EXPECT_LT(std::abs(result->projector_from_camera.translation[i] -
                       kTruth.projector_from_camera.translation[i]),
              4 * result->translation_deviations[i]);
  EXPECT_LT(result->start_disagreement, 1e-6);
  EXPECT_GT(result->held_out_projector_rms_px, result->projector_rms_px);
  EXPECT_EQ(result->left_out.size(), 6U);
  EXPECT_GT(result->pinhole.projector_rms_px, result->projector_rms_px);
  EXPECT_EQ(result->pinhole.lens.k1, 0);
}

TEST(Calibration, BearsGrossErrorsWithCauchysLoss) {
  std::vector<View> views = views_of(0.2);
  for (std::size_t v = 0; v < views.size(); ++v) {
    views[v].projector[3 * v] += Eigen::Vector2d(30, -20);
    views[v].camera[5 * v + 1] += Eigen::Vector2d(-25, 10);
  }
  views[0].projector[7].setConstant(NAN);  // not lit
  GeometryOptions options = options_for();
  options.loss = Loss::kCauchy;
  options.loss_px = 1;
  SilentProgress progress;
  const auto result = calibrate_geometry(views, options, progress);
  ASSERT_TRUE(result) << result.error().what;
  EXPECT_NEAR(result->projector.fx, kTruth.projector.fx, 0.01 * kTruth.projector.fx);
  EXPECT_NEAR(result->projector_from_camera.translation.x(), 0.25, 0.005);
  for (const ViewQuality& view : result->views) EXPECT_EQ(view.outliers, 2) << view.name;
}

TEST(Calibration, RefusesParallelBoardsWithTheReason) {
  std::vector<View> views;
  for (const double distance : {0.6, 0.7, 0.8, 0.9, 1.0})
    views.push_back(view_of(tilted(0.2, 0.1, distance), 0.1, views.size()));
  SilentProgress progress;
  const auto refused = calibrate_geometry(views, options_for(), progress);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_NE(refused.error().what.find("parallel"), std::string::npos) << refused.error().what;
}

TEST(Calibration, RefusesAFocalLengthThatIsTooUncertain) {
  GeometryOptions options = options_for();
  options.most_focal_deviation = 1e-5;
  SilentProgress progress;
  const auto refused = calibrate_geometry(views_of(0.3), options, progress);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("focal length"), std::string::npos) << refused.error().what;
}

TEST(Calibration, RefusesTooFewViewsAndMissingPoints) {
  SilentProgress progress;
  std::vector<View> views = views_of(0);
  EXPECT_EQ(calibrate_geometry(std::span(views).first(2), options_for(), progress).error().code,
            Errc::kInvalidOption);
  EXPECT_EQ(calibrate_geometry(views, {}, progress).error().code, Errc::kInvalidOption);
  for (Eigen::Vector2d& pixel : views[2].projector) pixel.setConstant(NAN);
  const auto refused = calibrate_geometry(views, options_for(), progress);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find(views[2].name), std::string::npos) << refused.error().what;
  views[2].projector.pop_back();
  EXPECT_EQ(calibrate_geometry(views, options_for(), progress).error().code, Errc::kInvalidOption);
}

TEST(Calibration, RefusesPointsThatContradictEachOther) {
  std::vector<View> views = views_of(0);
  Pcg32 random(1);
  for (View& view : views)
    for (Eigen::Vector2d& pixel : view.projector)
      pixel = {1900 * random.uniform(), 1000 * random.uniform()};
  SilentProgress progress;
  EXPECT_EQ(calibrate_geometry(views, options_for(), progress).error().code, Errc::kBadFormat);
}

TEST(RigEvaluation, TellsAnOptimumFromWhatStoppedBefore) {
  const std::vector<View> views = views_of(0.2);
  SilentProgress progress;
  const auto best = calibrate_geometry(views, options_for(), progress);
  ASSERT_TRUE(best) << best.error().what;
  Rig rig{best->camera, best->projector, best->projector_from_camera};
  const auto converged = evaluate_rig(rig, views, options_for());
  ASSERT_TRUE(converged) << converged.error().what;
  EXPECT_TRUE(converged->converged);
  rig.projector.fx *= 1.04;
  const auto stopped = evaluate_rig(rig, views, options_for());
  ASSERT_TRUE(stopped) << stopped.error().what;
  EXPECT_FALSE(stopped->converged);
  EXPECT_NEAR(stopped->optimum_rms_px, best->stereo_rms_px, 1e-6);
}

TEST(OpencvRig, RefusesWhatIsNone) {
  const TemporaryFolder folder;
  EXPECT_EQ(read_opencv_rig(folder.path() / "none.xml").error().code, Errc::kNotFound);
  ASSERT_TRUE(write_text(folder.path() / "bad.xml",
                         "<?xml version=\"1.0\"?><opencv_storage></opencv_storage>"));
  EXPECT_EQ(read_opencv_rig(folder.path() / "bad.xml").error().code, Errc::kBadFormat);
  ASSERT_TRUE(write_text(folder.path() / "text.xml", "no storage"));
  EXPECT_EQ(read_opencv_rig(folder.path() / "text.xml").error().code, Errc::kBadFormat);
}

TEST(Board, IsRefusedWhereItIsNotSeen) {
  const GreyPicture empty(200, 150, 90);
  const auto refused = find_board(empty.view(), kBoard);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotFound);
  EXPECT_EQ(find_board(empty.view(), Board{2, 7, 1}).error().code, Errc::kInvalidOption);
}

TEST(RealData, GiveThePublishedFiguresOrBetter) {
  const char* data = std::getenv("VENEER_DATA");
  const std::filesystem::path folder =
      std::filesystem::path(data != nullptr ? data : "../shared/data") / "procam_graycode";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "real data absent: " << folder;
  const PatternPlan plan = gray_code_plan(2048, 1536, 2).value();
  std::vector<View> views;
  for (int pose = 0; pose < 4; ++pose) {
    std::vector<GreyPicture> pictures;
    for (int i = 0; i < plan.pictures(); ++i) {
      const auto picture = read_png(folder / fmt::format("capture_{}/graycode_{:02}.png", pose, i));
      ASSERT_TRUE(picture) << picture.error().what;
      pictures.emplace_back(picture->width(), picture->height());
      for (std::size_t k = 0; k < picture->pixels().size(); ++k)
        pictures.back().pixels()[k] = picture->pixels()[k][0];
    }
    const auto view = observe_board(std::to_string(pose), pictures, plan, {9, 7, 75});
    ASSERT_TRUE(view) << view.error().what;
    EXPECT_EQ(view->corners_decoded, 63) << pose;
    EXPECT_GE(view->corner_decoded_ratio, 0.99) << pose;
    views.push_back(view->view);
  }
  GeometryOptions options = options_for();
  options.projector_width = 2048;
  options.projector_height = 1536;
  SilentProgress progress;
  const auto result = calibrate_geometry(views, options, progress);
  ASSERT_TRUE(result) << result.error().what;
  // The figures of another solver (OpenCV 4.6) on the same poses.
  EXPECT_NEAR(result->camera_rms_px, 0.329, 0.01);
  EXPECT_LT(result->stereo_rms_px, 0.41);
  EXPECT_LT(result->start_disagreement, 1e-6);
  EXPECT_EQ(result->left_out.size(), 4U);
  const auto rig = read_opencv_rig(folder / "calibration_result.xml");
  ASSERT_TRUE(rig) << rig.error().what;
  const auto published = evaluate_rig(*rig, views, options);
  ASSERT_TRUE(published) << published.error().what;
  EXPECT_FALSE(published->converged);
}

}  // namespace
}  // namespace veneer::geometry
