// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/camera/camera_colorimeter.h"

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

/// Sees one colour within a circle around a spot, another one outside.
class SpotCamera final : public capture::Camera {
 public:
  [[nodiscard]] std::string description() const override { return "spot camera"; }
  [[nodiscard]] int width() const override { return 64; }
  [[nodiscard]] int height() const override { return 48; }
  Status set_exposure(double seconds) override {
    exposure_s = seconds;
    return {};
  }
  [[nodiscard]] capture::ExposureRange exposure_range() const override { return {1e-6, 1e3}; }
  Result<capture::CameraFrame> grab() override {
    if (is_gone) return fail(Errc::kDisconnected, "gone");
    capture::CameraFrame frame;
    frame.counts = Image<Rgb16>(64, 48, Rgb16{outside, outside, outside});
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x)
        if (std::hypot(x + 0.5 - 20.5, y + 0.5 - 30.5) <= 6) frame.counts(x, y) = inside;
    frame.full_scale = 4095;
    frame.exposure_s = exposure_s;
    return frame;
  }
  Rgb16 inside{1000, 2000, 500};
  std::uint16_t outside = 4095;
  double exposure_s = 0.02;
  bool is_gone = false;
};

class CameraColorimeterTest : public ::testing::Test {
 protected:
  CameraColorimeter colorimeter() {
    return {camera_, options_, [this](Target, const Eigen::Vector2d&) { return spot_; }};
  }
  SpotCamera camera_;
  CameraColorimeterOptions options_{Eigen::Matrix3d::Identity(), 0.0, 5, 2};
  Eigen::Vector2d spot_{20.5, 30.5};
};

TEST_F(CameraColorimeterTest, ARateIsTheSameForEveryExposureAboveBlack) {
  options_.black_level = 100.0 / 4095;
  auto reader = colorimeter();
  const auto once = reader.read_rate(Target::kObject, {});
  ASSERT_TRUE(once) << once.error().what;
  EXPECT_TRUE(once->isApprox(Eigen::Vector3d(900, 1900, 400) / 4095 / 0.02));
  camera_.exposure_s = 0.04;
  camera_.inside = {1900, 3900, 900};
  EXPECT_TRUE(reader.read_rate(Target::kObject, {})->isApprox(*once));
}

TEST_F(CameraColorimeterTest, TheMatrixIsApplied) {
  options_.xyz_from_rate << 0, 1, 0, 0, 0, 2, 3, 0, 0;
  const auto xyz = colorimeter().read(Target::kObject, {});
  ASSERT_TRUE(xyz);
  EXPECT_TRUE(xyz->isApprox(Xyz(2000, 1000, 3000) / 4095 / 0.02));
}

TEST_F(CameraColorimeterTest, ASingleSaturatedPixelIsRefused) {
  options_.spot_radius = 7;  // into the ring of full counts
  const auto xyz = colorimeter().read(Target::kObject, {});
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kBadFormat);
  EXPECT_THAT(xyz.error().what, HasSubstr("saturated"));
}

TEST_F(CameraColorimeterTest, ASpotThatIsNotWhollyInThePictureIsRefused) {
  camera_.outside = 5;
  for (const Eigen::Vector2d& spot : {Eigen::Vector2d(4, 20),
                                      Eigen::Vector2d(20, 44),
                                      Eigen::Vector2d(1e12, 0),
                                      Eigen::Vector2d(NAN, 20)}) {
    spot_ = spot;
    const auto xyz = colorimeter().read(Target::kObject, {});
    ASSERT_FALSE(xyz) << spot.transpose();
    EXPECT_EQ(xyz.error().code, Errc::kNotFound);
  }
  spot_ = {5.5, 5.5};
  EXPECT_TRUE(colorimeter().read(Target::kObject, {}));
}

TEST_F(CameraColorimeterTest, TheCamerasErrorsArePassedOn) {
  camera_.is_gone = true;
  EXPECT_EQ(colorimeter().read(Target::kObject, {}).error().code, Errc::kDisconnected);
  camera_.is_gone = false;
  camera_.exposure_s = 0;
  EXPECT_EQ(colorimeter().read(Target::kObject, {}).error().code, Errc::kBadFormat);
}

TEST_F(CameraColorimeterTest, OptionsOutOfRangeAreRefused) {
  const auto refused = [](auto change) {
    CameraColorimeterOptions options;
    change(options);
    return !options.check().has_value();
  };
  EXPECT_TRUE(refused([](auto& o) { o.black_level = -0.1; }));
  EXPECT_TRUE(refused([](auto& o) { o.black_level = NAN; }));
  EXPECT_TRUE(refused([](auto& o) { o.frames = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.spot_radius = -1; }));
  EXPECT_TRUE(refused([](auto& o) { o.xyz_from_rate(0, 0) = INFINITY; }));
}

Eigen::Matrix3d true_matrix() {
  Eigen::Matrix3d m;
  m << 3.1, 1.2, 0.9, 1.4, 5.2, 0.3, 0.1, 0.6, 6.0;
  return m;
}

std::vector<CameraSample> samples(double noise) {
  Pcg32 random(2);
  std::vector<CameraSample> result;
  for (int i = 0; i < 24; ++i) {
    Eigen::Vector3d rate(random.uniform(), random.uniform(), random.uniform());
    if (i == 0) rate.setOnes();
    const Xyz xyz = true_matrix() * rate;
    for (int c = 0; c < 3; ++c) rate(c) *= 1 + noise * random.normal();
    result.push_back({rate, xyz});
  }
  return result;
}

TEST(CameraMatrix, OfSamplesThatObeyOneIsThatOne) {
  const auto fit = fit_camera_matrix(samples(0));
  ASSERT_TRUE(fit) << fit.error().what;
  EXPECT_TRUE(fit->xyz_from_rate.isApprox(true_matrix(), 1e-10));
  EXPECT_LT(fit->de00_max, 1e-6);
}

TEST(CameraMatrix, TheResidualTellsOfNoise) {
  const auto fit = fit_camera_matrix(samples(0.02));
  ASSERT_TRUE(fit);
  EXPECT_GT(fit->de00_mean, 0.1);
  EXPECT_GE(fit->de00_max, fit->de00_mean);
  EXPECT_TRUE(fit->xyz_from_rate.isApprox(true_matrix(), 0.1));
}

TEST(CameraMatrix, SamplesThatFixNoMatrixAreRefused) {
  EXPECT_FALSE(fit_camera_matrix({}));
  const std::vector<CameraSample> few = samples(0);
  EXPECT_FALSE(fit_camera_matrix(std::span(few).first(3)));
  std::vector<CameraSample> grey;
  for (int i = 1; i < 9; ++i) grey.push_back({Eigen::Vector3d::Constant(i), Xyz::Constant(i)});
  const auto monochrome = fit_camera_matrix(grey);
  ASSERT_FALSE(monochrome);
  EXPECT_THAT(monochrome.error().what, HasSubstr("one plane"));
  auto broken = samples(0);
  broken[5].rate.x() = std::nan("");
  EXPECT_FALSE(fit_camera_matrix(broken));
  auto dark = samples(0);
  for (CameraSample& sample : dark) sample.xyz.setZero();
  EXPECT_FALSE(fit_camera_matrix(dark));
}

}  // namespace
}  // namespace veneer::calibration
