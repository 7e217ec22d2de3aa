// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/statistics.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;
using testing::square;
using testing::truth_with_camera;

constexpr Rgb16 kFull{255, 255, 255};

/// A bench with its display and camera, the board in its first pose.
struct CameraOnBench {
  explicit CameraOnBench(const BenchTruth& truth) {
    auto made = Bench::create(truth, square(0.1));
    EXPECT_TRUE(made) << made.error().what;
    bench = std::move(*made);
    display = std::make_unique<VirtualPatchDisplay>(*bench);
    auto opened = VirtualCamera::create(*bench, *display);
    EXPECT_TRUE(opened) << opened.error().what;
    camera = std::move(*opened);
    EXPECT_TRUE(camera->place_board(0));
    EXPECT_TRUE(display->show(kFull));
  }
  [[nodiscard]] capture::CameraFrame grab() const {
    auto frame = camera->grab();
    EXPECT_TRUE(frame) << frame.error().what;
    return std::move(*frame);
  }
  std::unique_ptr<Bench> bench;
  std::unique_ptr<VirtualPatchDisplay> display;
  std::unique_ptr<VirtualCamera> camera;
};

/// A white board of even light and a camera of many counts and hardly any noise.
BenchTruth even_truth() {
  BenchTruth truth = truth_with_camera();
  truth.board->black = truth.board->white;
  truth.camera->bits = 16;
  truth.camera->full_well = 1e7;
  truth.camera->sensitivity = 1e6;
  truth.camera->read_noise = 0;
  return truth;
}

/// Mean counts in the middle of the board.
double middle_of(const CameraOnBench& on_bench,
                 const capture::CameraFrame& frame,
                 std::size_t channel) {
  const BoardTruth& board = *on_bench.bench->truth().board;
  const Eigen::Vector2d at = camera_pixel(
      *on_bench.bench->truth().camera,
      on_bench.camera->board_poses()[0] * board_corner(board, board.columns / 2, board.rows / 2));
  double sum = 0;
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x)
      sum += frame.counts(static_cast<int>(at.x()) + x, static_cast<int>(at.y()) + y)[channel];
  return sum / 25;
}

TEST(VirtualCamera, CountsGrowWithTheExposure) {
  const CameraOnBench on_bench(even_truth());
  ASSERT_TRUE(on_bench.camera->set_exposure(0.002));
  const double once = middle_of(on_bench, on_bench.grab(), 1);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.006));
  const capture::CameraFrame longer = on_bench.grab();
  EXPECT_EQ(longer.exposure_s, 0.006);
  // Shot noise: 1 / sqrt(25 pixels of a million electrons), five times over.
  EXPECT_NEAR(middle_of(on_bench, longer, 1) / once, 3, 3 * 1e-3);
}

TEST(VirtualCamera, WhatIsTooBrightIsAtFullScaleAndNoMore) {
  const CameraOnBench on_bench(even_truth());
  ASSERT_TRUE(on_bench.camera->set_exposure(1));
  const capture::CameraFrame frame = on_bench.grab();
  EXPECT_EQ(frame.full_scale, 65535);
  EXPECT_EQ(middle_of(on_bench, frame, 0), 65535);
}

TEST(VirtualCamera, HasTheNoiseOfItsElectrons) {
  BenchTruth truth = even_truth();
  truth.camera->full_well = 10000;
  truth.camera->sensitivity = 2000;
  truth.camera->read_noise = 20;
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.002));
  const capture::CameraFrame one = on_bench.grab();
  const capture::CameraFrame two = on_bench.grab();
  // Pairs of pixels of one light: shot noise of the electrons and the noise of reading. The dark
  // around the board is cut at 0.
  const double electrons_per_count = 10000 / 65535.0;
  double squares = 0;
  double expected = 0;
  int pixels = 0;
  for (std::size_t i = 0; i < one.counts.pixels().size(); ++i) {
    const double a = one.counts.pixels()[i][1] * electrons_per_count;
    const double b = two.counts.pixels()[i][1] * electrons_per_count;
    if (a + b < 1000) continue;
    squares += (a - b) * (a - b) / 2;
    expected += (a + b) / 2 + 20 * 20;
    ++pixels;
  }
  ASSERT_GT(pixels, 1000);
  EXPECT_NEAR(squares / expected, 1, 5 * std::sqrt(2.0 / pixels));
}

TEST(VirtualCamera, SeesTheColourOfTheLight) {
  const CameraOnBench on_bench(even_truth());
  ASSERT_TRUE(on_bench.camera->set_exposure(0.005));
  for (std::size_t c = 0; c < 3; ++c) {
    Rgb16 code{};
    code[c] = 255;
    ASSERT_TRUE(on_bench.display->show(code));
    const capture::CameraFrame frame = on_bench.grab();
    for (std::size_t other = 0; other < 3; ++other) {
      if (other == c) continue;
      EXPECT_GT(middle_of(on_bench, frame, c), 2 * middle_of(on_bench, frame, other)) << c << other;
    }
  }
}

TEST(VirtualCamera, PatchAndPictureOfOneCodeLookTheSame) {
  BenchTruth truth = even_truth();
  truth.projector.blur_px = 0.5;
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.display->show({200, 100, 50}));
  const double patch = middle_of(on_bench, on_bench.grab(), 0);
  ASSERT_TRUE(on_bench.display->show(kFull));
  const double full = middle_of(on_bench, on_bench.grab(), 0);
  const Image<Rgb16> picture(64, 48, {200, 100, 50});
  ASSERT_TRUE(on_bench.display->show_picture(picture.view()));
  EXPECT_NEAR(middle_of(on_bench, on_bench.grab(), 0) / patch, 1, 1e-3);
  EXPECT_GT(full, 1.1 * patch);
}

TEST(VirtualCamera, WithoutABoardOrWithTheLampOffThereIsNoLight) {
  BenchTruth truth = even_truth();
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.display->show(kFull, false));
  EXPECT_EQ(middle_of(on_bench, on_bench.grab(), 1), 0);
  ASSERT_TRUE(on_bench.display->show(kFull));
  EXPECT_GT(middle_of(on_bench, on_bench.grab(), 1), 0);
  on_bench.camera->remove_board();
  EXPECT_EQ(middle_of(on_bench, on_bench.grab(), 1), 0);
}

TEST(VirtualCamera, AmbientLightIsThereWithTheLampOff) {
  BenchTruth truth = even_truth();
  truth.room.ambient_nits = 100;
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.01));
  const double both = middle_of(on_bench, on_bench.grab(), 1);
  ASSERT_TRUE(on_bench.display->show(kFull, false));
  const double ambient = middle_of(on_bench, on_bench.grab(), 1);
  // About 100 of 900 cd/m^2; the channel's weights and the slant matter a little.
  EXPECT_GT(ambient, 0.05 * both);
  EXPECT_LT(ambient, 0.25 * both);
}

TEST(VirtualCamera, AGrabTakesTimeAndSaysWhenItWas) {
  BenchTruth truth = even_truth();
  truth.projector.lamp_drift = 0.2;
  truth.projector.lamp_settling_s = 1;
  const CameraOnBench on_bench(truth);
  const double first = middle_of(on_bench, on_bench.grab(), 1);
  EXPECT_NEAR(to_seconds(on_bench.display->now().time_since_epoch()), 0.1, 1e-9);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.005));
  on_bench.display->pass(60);
  const capture::CameraFrame settled = on_bench.grab();
  EXPECT_NEAR(to_seconds(settled.time.time_since_epoch()), 60.2 - 0.0025, 1e-6);
  EXPECT_NEAR(first / middle_of(on_bench, settled, 1), 1 - 0.2 * std::exp(-0.1), 2e-3);
}

TEST(VirtualCamera, TakesTheSamePicturesForTheSameSeed) {
  BenchTruth truth = truth_with_camera();
  const CameraOnBench one(truth);
  const CameraOnBench two(truth);
  truth.camera->seed = 2;
  const CameraOnBench other(truth);
  for (int i = 0; i < 2; ++i) {
    const capture::CameraFrame a = one.grab();
    const capture::CameraFrame b = two.grab();
    const capture::CameraFrame c = other.grab();
    EXPECT_TRUE(std::ranges::equal(a.counts.pixels(), b.counts.pixels()));
    EXPECT_FALSE(std::ranges::equal(a.counts.pixels(), c.counts.pixels()));
  }
}

TEST(VirtualCamera, RefusesWhatItCannotDo) {
  const CameraOnBench on_bench(truth_with_camera());
  for (const double seconds : {0.0, 1e-5, 1.5, std::nan("")}) {
    const Status status = on_bench.camera->set_exposure(seconds);
    ASSERT_FALSE(status) << seconds;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption);
    EXPECT_THAT(status.error().what, HasSubstr("0.0001 and 1 s"));
  }
  for (const int pose : {-1, 8}) {
    const Status status = on_bench.camera->place_board(pose);
    ASSERT_FALSE(status) << pose;
    EXPECT_THAT(status.error().what, HasSubstr("0 to 7"));
  }
  const auto bench = Bench::create(testing::plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  const auto camera = VirtualCamera::create(**bench, display);
  ASSERT_FALSE(camera);
  EXPECT_THAT(camera.error().what, HasSubstr("[camera]"));
}

TEST(VirtualCamera, SeesTheObjectAsItSeesABoardOfItsMaterialInItsPlace) {
  BenchTruth truth = even_truth();
  truth.object.reflectance = {truth.board->white};
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.002));
  // Both square to the axis at the world's origin; the object is the larger one.
  const BoardTruth& board = *truth.board;
  on_bench.camera->place_board(
      {Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX())),
       {-0.5 * (board.columns - 1) * board.square_m, 0.5 * (board.rows - 1) * board.square_m, 0}});
  const Image<Rgb16> of_board = on_bench.grab().counts;
  on_bench.camera->place_object({});
  EXPECT_NE(on_bench.grab().counts(160, 120), Rgb16{}) << "the board is in the way";
  on_bench.camera->remove_board();
  const Image<Rgb16> of_object = on_bench.grab().counts;
  int compared = 0;
  for (int y = 100; y < 140; ++y)
    for (int x = 140; x < 180; ++x)
      for (std::size_t c = 0; c < 3; ++c) {
        ASSERT_GT(of_board(x, y)[c], 1000);
        // Shot noise of some 100 000 electrons in both, five times over.
        EXPECT_NEAR(of_object(x, y)[c], of_board(x, y)[c], 0.025 * of_board(x, y)[c]);
        ++compared;
      }
  EXPECT_EQ(compared, 3 * 40 * 40);
}

TEST(VirtualCamera, SeesPaintDarkerByItsReflectance) {
  BenchTruth truth = even_truth();
  truth.object.reflectance = {0.8};
  truth.object.texture = ObjectTruth::Texture::kStripes;
  truth.object.texture_fields = 2;  // the right half of the plate
  truth.object.texture_reflectance = {0.2};
  const CameraOnBench on_bench(truth);
  ASSERT_TRUE(on_bench.camera->set_exposure(0.002));
  on_bench.camera->remove_board();
  on_bench.camera->place_object({});
  const Image<Rgb16> picture = on_bench.grab().counts;
  const auto mean_about = [&](const Eigen::Vector3d& point) {
    const Eigen::Vector2d at = camera_pixel(*truth.camera, point);
    double sum = 0;
    for (int y = -3; y <= 3; ++y)
      for (int x = -3; x <= 3; ++x)
        sum += picture(static_cast<int>(at.x()) + x, static_cast<int>(at.y()) + y)[1];
    return sum / 49;
  };
  // Alike in the projector's light, left and right of its axis.
  EXPECT_NEAR(mean_about({0.04, 0, 0}) / mean_about({-0.04, 0, 0}), 0.25, 0.005);
}

}  // namespace
}  // namespace veneer::simulation
