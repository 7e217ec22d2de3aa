// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/colorimeter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "calibration/radiometry.h"
#include "calibration/verification.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using calibration::Target;
using testing::plain_truth;
using testing::square;

TEST(VirtualColorimeter, ReadsTheSameForTheSameSeed) {
  const auto bench = Bench::create(plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  VirtualColorimeter one(**bench, display, {});
  VirtualColorimeter two(**bench, display, {});
  ASSERT_TRUE(display.show({200, 100, 50}));
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(*one.read(Target::kObject, {10, 10}), *two.read(Target::kObject, {10, 10}));
}

TEST(VirtualColorimeter, HasTheNoiseAskedFor) {
  const auto bench = Bench::create(plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  VirtualColorimeter colorimeter(**bench, display, {0.01, 0.0, 3});
  ASSERT_TRUE(display.show({255, 255, 255}));
  const double truth = (*bench)->board({255, 255, 255}, {32, 24}, true, false).y();
  double mean = 0;
  double square_sum = 0;
  constexpr int kReadings = 4000;
  for (int i = 0; i < kReadings; ++i) {
    const double error = colorimeter.read(Target::kWhiteReference, {32, 24})->y() / truth - 1;
    mean += error / kReadings;
    square_sum += error * error / kReadings;
  }
  // Five standard errors of mean and deviation of 4000 readings.
  EXPECT_NEAR(mean, 0, 5 * 0.01 / std::sqrt(kReadings));
  EXPECT_NEAR(std::sqrt(square_sum), 0.01, 5 * 0.01 / std::sqrt(2.0 * kReadings));
}

TEST(VirtualColorimeter, HasTheDriftAndTheMatrixErrorAskedFor) {
  const auto bench = Bench::create(plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  InstrumentTruth truth;
  truth.relative_noise = 0;
  truth.dark_noise_nits = 0;
  truth.drift_per_hour = 0.1;
  truth.matrix_error << 0.01, -0.02, 0.003, 0.004, 0.005, -0.006, 0.007, 0.008, 0.009;
  VirtualColorimeter colorimeter(**bench, display, options_from(truth));
  ASSERT_TRUE(display.show({255, 100, 30}));
  const Xyz light = (*bench)->board({255, 100, 30}, {32, 24}, 1, false);
  const Xyz off = light + truth.matrix_error * light;
  const Xyz at_first = *colorimeter.read(Target::kWhiteReference, {32, 24});
  EXPECT_TRUE(at_first.isApprox(off * (1 + 0.1 / 3600), 1e-12)) << "after the reading's second";
  display.pass(7199);
  const Xyz at_last = *colorimeter.read(Target::kWhiteReference, {32, 24});
  EXPECT_TRUE(at_last.isApprox(off * (1 + 0.1 * 7201 / 3600), 1e-12));
}

TEST(VirtualColorimeter, OfAPictureReadsThePixelsOwnCode) {
  const auto bench = Bench::create(plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  VirtualColorimeter colorimeter(**bench, display, {0, 0, 1});
  Image<Rgb16> picture(64, 48);
  picture(63, 10) = {9, 8, 7};
  ASSERT_TRUE(display.show_picture(picture.view()));
  EXPECT_EQ(*colorimeter.read(Target::kObject, {64, 10.5}),
            (*bench)->board({9, 8, 7}, {64, 10.5}, 1, true));
  EXPECT_EQ(*colorimeter.read(Target::kObject, {5, 5}), (*bench)->board({}, {5, 5}, 1, true));
}

TEST(VirtualPatchDisplay, TheLampSettlesWithItsTimeConstant) {
  BenchTruth truth = plain_truth();
  truth.projector.lamp_drift = 0.03;
  truth.projector.lamp_settling_s = 100;
  const auto bench = Bench::create(truth, square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  ASSERT_TRUE(display.show({255, 255, 255}));
  EXPECT_DOUBLE_EQ(display.lamp(), 0.97);
  VirtualColorimeter colorimeter(**bench, display, {0, 0, 1});
  const double settled = (*bench)->board({255, 255, 255}, {32, 24}, 1, false).y();
  for (int second = 1; second <= 400; ++second) {
    const double y = colorimeter.read(Target::kWhiteReference, {32, 24})->y();
    ASSERT_NEAR(y, settled * (1 - 0.03 * std::exp(-second / 100.0)), 1e-9 * settled) << second;
  }
  ASSERT_TRUE(display.show({255, 255, 255}, false));
  EXPECT_EQ(display.lamp(), 0);
}

TEST(VirtualColorimeter, RefusesWhatIsNotOnTheRaster) {
  const auto bench = Bench::create(plain_truth(), square(0.1));
  ASSERT_TRUE(bench);
  VirtualPatchDisplay display(**bench);
  VirtualColorimeter colorimeter(**bench, display, {});
  EXPECT_FALSE(colorimeter.read(Target::kObject, {-1, 3}));
  EXPECT_FALSE(colorimeter.read(Target::kObject, {3, 49}));
  EXPECT_FALSE(colorimeter.read(Target::kObject, {3, std::nan("")}));
  EXPECT_FALSE(display.show({0, 0, 256}));
}

TEST(MeasureProfile, OfTheDemosBenchPredictsWhatItHasNotSeen) {
  const auto bench = Bench::load(VENEER_ETC "/benches/demo.toml");
  ASSERT_TRUE(bench) << bench.error().what;
  VirtualPatchDisplay display(**bench);
  VirtualColorimeter colorimeter(**bench, display, {});
  calibration::RadiometryOptions options;
  options.reference_distance_m = (*bench)->truth().projector.reference_distance_m;
  SilentProgress progress;
  const auto measured =
      calibration::measure_profile(colorimeter, display, true_geometry(**bench), options, progress);
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_TRUE(measured->warnings.empty()) << measured->warnings.front();

  const auto patches = calibration::verification_patches(measured->profile, 300, 77);
  const auto verified =
      calibration::verify_profile(colorimeter, display, measured->profile, patches, {1}, progress);
  ASSERT_TRUE(verified) << verified.error().what;
  EXPECT_LT(verified->de00_mean, 1.0);
  RecordProperty("de00_mean", fmt::format("{:.3f}", verified->de00_mean));
  RecordProperty("de00_p95", fmt::format("{:.3f}", verified->de00_p95));
  RecordProperty("de00_max", fmt::format("{:.3f}", verified->de00_max));
  RecordProperty("additivity", fmt::format("{:.4f}", measured->additivity_error));
}

}  // namespace
}  // namespace veneer::simulation
