// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/studio.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "base/files.h"
#include "simulation/studio/camera.h"
#include "simulation/studio/hands.h"
#include "simulation/studio/polariser.h"
#include "simulation/studio/rig.h"
#include "simulation/studio/testing.h"

namespace veneer::simulation {
namespace {

using capture::HandRequest;
using capture::Target;
using ::testing::HasSubstr;
using testing::kDegree;
using testing::small_plan;
using testing::small_truth;
using Task = HandRequest::Task;

std::unique_ptr<VirtualStudio> made(const StudioTruth& truth,
                                    const capture::CapturePlan& plan = small_plan()) {
  SilentProgress silent;
  auto studio = VirtualStudio::create(truth, plan, {}, silent);
  EXPECT_TRUE(studio) << studio.error().what;
  return std::move(*studio);
}

HandRequest asked(Task task, int index = 0, double angle_rad = 0) {
  return {task, Target::kSample, index, angle_rad, {}};
}
HandRequest lay(Target target) { return {Task::kPlaceTarget, target, 0, 0, {}}; }

bool same(const Image<Rgb32f>& a, const Image<Rgb32f>& b) {
  return std::ranges::equal(a.pixels(), b.pixels());
}

StudioTruth noisy_truth() {
  StudioTruth truth = small_truth();
  truth.bits = 12;
  truth.full_well = 20000;
  truth.read_noise = 4;
  truth.dark_current = 2;
  truth.offset_counts = 16;
  truth.vignetting = 0.3;
  truth.ambient = 0.01;
  return truth;
}

TEST(VirtualStudio, TheMeanOfManyPicturesIsTheLight) {
  StudioTruth truth = noisy_truth();
  truth.offset_counts = 0;
  truth.dark_current = 0;
  const auto studio = made(truth);
  ASSERT_TRUE(studio->camera().set_exposure(0.12));
  const Image<Rgb32f> light = studio->light();
  Image<Rgb32f> mean(light.width(), light.height());
  constexpr int kPictures = 100;
  for (int i = 0; i < kPictures; ++i) {
    const auto frame = studio->camera().grab();
    ASSERT_TRUE(frame) << frame.error().what;
    EXPECT_EQ(frame->full_scale, 4095);
    for (std::size_t p = 0; p < mean.pixels().size(); ++p)
      for (int c = 0; c < 3; ++c)
        mean.pixels()[p][c] += static_cast<float>(
            frame->counts.pixels()[p][static_cast<std::size_t>(c)] / (1.0 * kPictures));
  }
  const double electrons_per_count = 0.95 * 20000 / 4095;
  double chi_squared = 0;
  double sum_of_errors = 0;
  int count = 0;
  for (std::size_t p = 0; p < mean.pixels().size(); ++p)
    for (int c = 0; c < 3; ++c) {
      const double electrons = light.pixels()[p][c] * 20000 * 1.2;
      // Near 0 counts are cut off; near the top too.
      if (electrons < 100 || electrons > 17000) continue;
      const double wanted = electrons / electrons_per_count;
      const double variance =
          ((electrons + 16) / (electrons_per_count * electrons_per_count) + 1.0 / 12) / kPictures;
      const double error = (mean.pixels()[p][c] - wanted) / std::sqrt(variance);
      ASSERT_LT(std::abs(error), 6) << p;
      chi_squared += error * error;
      sum_of_errors += error;
      ++count;
    }
  ASSERT_GT(count, 5000);
  EXPECT_NEAR(chi_squared / count, 1, 5 * std::sqrt(2.0 / count) + 0.01);
  EXPECT_LT(std::abs(sum_of_errors) / std::sqrt(count), 5);
}

TEST(VirtualStudio, TheTruthIsThatOfTheRigsAxis) {
  const capture::CapturePlan plan = small_plan();
  const auto studio = made(small_truth());
  for (int light = 0; light < 2; ++light) {
    // s-polarised, incidence half the angle between light and view.
    const auto truth = studio->truth(0, light);
    const double i = 0.5 * std::acos(plan.lights[static_cast<std::size_t>(light)].z());
    const double t = std::asin(std::sin(i) / 1.5);
    const double s = std::pow(std::sin(i - t) / std::sin(i + t), 2);
    const double p = std::pow(std::tan(i - t) / std::tan(i + t), 2);
    ASSERT_EQ(truth.specular.width(), 8);
    for (std::size_t texel = 0; texel < 64; ++texel)
      EXPECT_NEAR(truth.specular.pixels()[texel].x(),
                  2 * s / (s + p) * truth.unpolarised_specular.pixels()[texel].x(),
                  1e-5);
  }
  // Light and axis in one plane: p-polarised light loses what s gains.
  capture::CapturePlan turned = small_plan();
  turned.polarisation.axis = Eigen::Vector3d::UnitX();
  const auto across = made(small_truth(), turned);
  const auto of_s = studio->truth(0, 1);
  const auto of_p = across->truth(0, 1);
  for (std::size_t texel = 0; texel < 64; ++texel)
    EXPECT_NEAR((of_s.specular.pixels()[texel] + of_p.specular.pixels()[texel] -
                 2 * of_s.unpolarised_specular.pixels()[texel])
                    .norm(),
                0,
                1e-4);
}

TEST(VirtualStudio, TheSameSeedGivesTheSamePictures) {
  const auto one = made(noisy_truth());
  const auto other = made(noisy_truth());
  StudioTruth truth = noisy_truth();
  truth.seed = 2;
  const auto third = made(truth);
  for (int i = 0; i < 3; ++i) {
    const auto a = one->camera().grab();
    const auto b = other->camera().grab();
    const auto c = third->camera().grab();
    ASSERT_TRUE(a && b && c);
    EXPECT_TRUE(std::ranges::equal(a->counts.pixels(), b->counts.pixels()));
    EXPECT_EQ(a->time, b->time);
    EXPECT_FALSE(std::ranges::equal(a->counts.pixels(), c->counts.pixels()));
  }
}

TEST(VirtualStudio, PicturesAreLostAndRepeatedAsOftenAsItSays) {
  StudioTruth truth = noisy_truth();
  truth.width = 16;
  truth.height = 16;
  truth.principal_point = {8, 8};
  truth.dropped = 0.2;
  truth.repeated = 0.1;
  const auto studio = made(truth);
  constexpr int kGrabs = 4000;
  int lost = 0;
  int repeated = 0;
  std::uint64_t highest = 0;
  Image<Rgb16> last;
  for (int i = 0; i < kGrabs; ++i) {
    const auto frame = studio->camera().grab();
    if (!frame) {
      EXPECT_EQ(frame.error().code, Errc::kTimeout);
      ++lost;
    } else if (frame->sequence <= highest) {
      EXPECT_EQ(frame->sequence, highest);
      EXPECT_TRUE(std::ranges::equal(frame->counts.pixels(), last.pixels()));
      ++repeated;
    } else {
      highest = frame->sequence;
      last = frame->counts;
    }
  }
  // Four standard deviations of a binomial count.
  EXPECT_NEAR(lost, 0.2 * kGrabs, 4 * std::sqrt(kGrabs * 0.2 * 0.8));
  EXPECT_NEAR(repeated, 0.1 * kGrabs, 4 * std::sqrt(kGrabs * 0.1 * 0.9));
  // A lost picture leaves a gap in the numbers, a repeated one does not.
  EXPECT_LE(highest, static_cast<std::uint64_t>(kGrabs - repeated));
  EXPECT_GE(highest + 20, static_cast<std::uint64_t>(kGrabs - repeated));
}

TEST(VirtualStudio, TimePassesAsThingsAreDone) {
  const auto studio = made(small_truth());
  const auto seconds = [&](const auto& work) {
    const Time before = studio->clock().now();
    EXPECT_TRUE(work());
    return to_seconds(studio->clock().now() - before);
  };
  using studio::StudioCamera;
  using studio::StudioHands;
  using studio::StudioPolariser;
  EXPECT_NEAR(seconds([&] { return studio->hands().please(asked(Task::kPlaceLight, 1)); }),
              StudioHands::kMove_s,
              1e-9);
  EXPECT_NEAR(seconds([&] { return studio->hands().please(asked(Task::kDarken)); }),
              StudioHands::kSwitch_s,
              1e-9);
  EXPECT_NEAR(
      seconds([&] { return studio->polariser()->turn_to(1); }), StudioPolariser::kTurn_s, 1e-9);
  ASSERT_TRUE(studio->camera().set_exposure(0.5));
  const Time before = studio->clock().now();
  const auto frame = studio->camera().grab();
  ASSERT_TRUE(frame);
  EXPECT_NEAR(to_seconds(studio->clock().now() - before), 0.5 + StudioCamera::kReadOut_s, 1e-9);
  EXPECT_NEAR(to_seconds(frame->time - before), 0.25, 1e-9);
  EXPECT_EQ(frame->exposure_s, 0.5);
}

TEST(VirtualStudio, HandsChangeWhatIsSeen) {
  const auto studio = made(small_truth());
  const Rgb32f sample = studio->light()(81, 61);
  ASSERT_TRUE(studio->hands().please(lay(Target::kWhite)));
  EXPECT_NEAR(studio->light()(81, 61).x(), 0.5 * 0.99 * std::cos(10 * kDegree), 1e-5);
  ASSERT_TRUE(studio->hands().please(asked(Task::kPlaceLight, 1)));
  EXPECT_NEAR(studio->light()(81, 61).x(), 0.5 * 0.99 * std::cos(30 * kDegree), 1e-5);
  ASSERT_TRUE(studio->hands().please(asked(Task::kDarken)));
  EXPECT_EQ(studio->light()(81, 61).norm(), 0);
  ASSERT_TRUE(studio->hands().please(asked(Task::kLight)));
  ASSERT_TRUE(studio->hands().please(lay(Target::kSample)));
  ASSERT_TRUE(studio->hands().please(asked(Task::kPlaceLight, 0)));
  EXPECT_EQ(studio->light()(81, 61), sample);
  ASSERT_TRUE(studio->hands().please(asked(Task::kTurnAnalyser, 0, 90 * kDegree)));
  EXPECT_LT(studio->light()(81, 61).x(), sample.x());
  const auto turned = studio->light();
  ASSERT_TRUE(studio->polariser()->turn_to(90 * kDegree));
  EXPECT_TRUE(same(studio->light(), turned));
}

TEST(VirtualStudio, WhatCannotBeDoneIsNamed) {
  capture::CapturePlan plan = small_plan();
  plan.mirror_light.reset();
  const auto studio = made(small_truth(), plan);
  const auto expect_refused = [&](const Status& status, Errc code, const char* reason) {
    ASSERT_FALSE(status) << reason;
    EXPECT_EQ(status.error().code, code);
    EXPECT_THAT(status.error().what, HasSubstr(reason));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused(studio->hands().please(asked(Task::kPlaceLight, 3)),
                 Errc::kInvalidOption,
                 "no light 3; the plan has 0 to 2");
  expect_refused(
      studio->hands().please(asked(Task::kPlaceView, -1)), Errc::kInvalidOption, "view -1");
  expect_refused(
      studio->hands().please(lay(Target::kMirror)), Errc::kUnavailable, "[mirror] light");
  expect_refused(studio->polariser()->turn_to(nan), Errc::kInvalidOption, "nan");
  for (const double exposure : {0.0, 11.0, -1.0, nan})
    expect_refused(studio->camera().set_exposure(exposure), Errc::kInvalidOption, "10 s");
  for (const double gain : {-1.0, 30.0, nan})
    expect_refused(studio->camera().set_gain_db(gain), Errc::kInvalidOption, "24 dB");
  expect_refused(
      studio->camera().set_trigger(capture::Trigger::kHardware), Errc::kUnavailable, "software");

  StudioTruth truth = small_truth();
  truth.mosaic = true;
  const auto mosaic = made(truth);
  EXPECT_EQ(mosaic->polariser(), nullptr);
  expect_refused(
      mosaic->hands().please(asked(Task::kTurnAnalyser)), Errc::kUnavailable, "on the sensor");
}

TEST(VirtualStudio, AStudioThatCannotBeIsRefused) {
  SilentProgress silent;
  StudioTruth truth = small_truth();
  truth.bits = 20;
  const auto bits = VirtualStudio::create(truth, small_plan(), {}, silent);
  ASSERT_FALSE(bits);
  EXPECT_EQ(bits.error().code, Errc::kInvalidOption);
  EXPECT_THAT(bits.error().what, HasSubstr("bits is 20"));
  capture::CapturePlan plan = small_plan();
  plan.lights.push_back(plan.lights.front());
  const auto twice = VirtualStudio::create(small_truth(), plan, {}, silent);
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error().code, Errc::kInvalidOption);
  truth = small_truth();
  truth.tile_mm = 9999;
  const auto huge = VirtualStudio::create(truth, small_plan(), {}, silent);
  ASSERT_FALSE(huge);
  EXPECT_THAT(huge.error().what, HasSubstr("size"));
}

TEST(VirtualStudio, ATileRepeatsOverTheSample) {
  capture::CapturePlan plan = small_plan();
  plan.area.height_mm = 12;
  plan.area.rows = 6;
  StudioTruth truth = small_truth();
  truth.tile_mm = 8;  // 4 texels
  const auto studio = made(truth, plan);
  const auto diffuse = studio->truth(0, 0).diffuse;
  ASSERT_EQ(diffuse.height(), 6);
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 8; ++column)
      EXPECT_EQ(diffuse(column, row), diffuse(column % 4, row % 4)) << column << ", " << row;
  EXPECT_NE(diffuse(0, 0), diffuse(1, 0));
}

TEST(VirtualStudio, GainMakesTheSameLightBrighter) {
  const auto studio = made(small_truth());
  ASSERT_TRUE(studio->camera().set_exposure(0.02));
  const auto once = studio->camera().grab();
  ASSERT_TRUE(studio->camera().set_gain_db(6.0206));
  const auto twice = studio->camera().grab();
  ASSERT_TRUE(once && twice);
  EXPECT_NEAR(twice->counts(81, 61)[0], 2 * once->counts(81, 61)[0], 2);
}

TEST(VirtualStudio, AMosaicSaysThatItIsOne) {
  StudioTruth truth = small_truth();
  truth.mosaic = true;
  const auto frame = made(truth)->camera().grab();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->mosaic, capture::Mosaic::kPolarMono);
  const auto whole = made(small_truth())->camera().grab();
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->mosaic, capture::Mosaic::kNone);
}

TEST(VirtualStudio, LightsMissTheirPlacesByWhatItSays) {
  capture::CapturePlan plan = small_plan();
  plan.area.columns = plan.area.rows = 1;
  plan.lights.clear();
  for (int i = 0; i < 200; ++i) plan.lights.push_back(testing::on_arc(-60 + 0.6 * i));
  StudioTruth truth = small_truth();
  truth.samples = 1;
  const auto exact = made(truth, plan);
  truth.light_aim_error_deg = 0.5;
  const auto off = made(truth, plan);
  double squares = 0;
  for (int i = 0; i < 200; ++i) {
    EXPECT_NEAR(
        (exact->light_direction(i) - plan.lights[static_cast<std::size_t>(i)]).norm(), 0, 1e-12);
    EXPECT_NEAR(off->light_direction(i).norm(), 1, 1e-12);
    squares += (off->light_direction(i) - exact->light_direction(i)).squaredNorm();
  }
  // Two axes for each light; the standard error of a deviation from 400 is 3.5 %.
  EXPECT_NEAR(std::sqrt(squares / 400) / kDegree, 0.5, 0.07);
}

TEST(VirtualStudio, TheCamerasPoseIsThatOfItsPictures) {
  capture::CapturePlan plan = small_plan();
  plan.area.lift_mm = 2;
  const auto studio = made(small_truth(), plan);
  const capture::CameraLens lens = studio->lens();
  for (int view = 0; view < 2; ++view) {
    const RigidTransform pose = studio->camera_from_board(view);
    // The middle of the sample, which the camera looks at, is 2 mm before the board.
    const Eigen::Vector3d middle = pose * Eigen::Vector3d(0.033, 0.027, -0.002);
    EXPECT_NEAR((middle - Eigen::Vector3d(0, 0, 0.8)).norm(), 0, 1e-12);
    const Eigen::Vector3d right = pose * Eigen::Vector3d(0.043, 0.027, -0.002);
    EXPECT_GT(right.x(), 0.009);
    EXPECT_NEAR(right.y(), 0, 1e-12);
    EXPECT_GT((pose * Eigen::Vector3d(0.033, 0.037, -0.002)).y(), 0.009);
  }
  EXPECT_EQ(lens.focal_px, Eigen::Vector2d(1600, 1600));
}

/// A folder that is gone after the test.
class StudioCache : public ::testing::Test {
 protected:
  StudioCache()
      : folder_(std::filesystem::temp_directory_path() /
                fmt::format("veneer_studio_cache_{}", ::getpid())) {}
  ~StudioCache() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] Image<Rgb32f> specular(const StudioTruth& truth) const {
    SilentProgress silent;
    auto studio = VirtualStudio::create(truth, small_plan(), folder_, silent);
    EXPECT_TRUE(studio) << studio.error().what;
    return (*studio)->truth(0, 0).specular;
  }
  [[nodiscard]] std::vector<std::filesystem::path> sets() const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      found.push_back(entry.path());
    return found;
  }
  std::filesystem::path folder_;
};

TEST_F(StudioCache, ATracedSampleIsFoundAgain) {
  const auto traced = specular(small_truth());
  ASSERT_EQ(sets().size(), 1U);
  const auto samples = sets().front() / "samples.safetensors";
  const auto written = std::filesystem::last_write_time(samples);
  const auto found = specular(small_truth());
  EXPECT_TRUE(same(traced, found));
  EXPECT_EQ(std::filesystem::last_write_time(samples), written);
  // Of another seed it is another.
  StudioTruth truth = small_truth();
  truth.material_seed = 7;
  EXPECT_FALSE(same(specular(truth), traced));
  EXPECT_EQ(sets().size(), 2U);
}

TEST_F(StudioCache, WhatIsDamagedOrOfAnotherMakeIsTracedAgain) {
  const auto traced = specular(small_truth());
  const auto set = sets().front();
  ASSERT_TRUE(write_text(set / "samples.safetensors", "no samples"));
  EXPECT_TRUE(same(specular(small_truth()), traced));
  // A sound set in its place whose lights are others.
  ASSERT_TRUE(write_text(set / "lights.csv", "theta,phi\n1,0\n2,0\n3,0\n"));
  EXPECT_TRUE(same(specular(small_truth()), traced));
  EXPECT_EQ(sets().size(), 1U);
}

}  // namespace
}  // namespace veneer::simulation
