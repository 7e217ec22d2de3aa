// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "simulation/bench.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using testing::plain_truth;
using testing::square;

class ComparisonTest : public ::testing::Test {
 protected:
  void SetUp() override {
    BenchTruth truth = plain_truth();
    truth.room.ambient_nits = 1;
    truth.object.reflectance = {0.8};
    auto bench = Bench::create(truth, *load_mesh("sphere"));
    ASSERT_TRUE(bench) << bench.error().what;
    bench_ = std::move(*bench);
    auto view = bench_->look({}, {0.1, 0.1, 1});
    ASSERT_TRUE(view);
    view_ = std::move(*view);
  }
  /// A frame with a ramp from left to right in red and from top to bottom in blue.
  static Image<Rgb16> ramps(bool mirrored) {
    Image<Rgb16> frame(64, 48);
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x)
        frame(mirrored ? 63 - x : x, y) = {
            static_cast<std::uint16_t>(4 * x), 100, static_cast<std::uint16_t>(5 * y)};
    return frame;
  }
  Image<Rgb32f> seen(const Image<Rgb16>& frame) { return *bench_->observe(view_, frame.view()); }

  std::unique_ptr<Bench> bench_;
  EyeView view_;
};

TEST_F(ComparisonTest, EqualPicturesDoNotDiffer) {
  const Image<Rgb32f> picture = seen(ramps(false));
  const auto c = bench_->compare(view_, picture, picture);
  ASSERT_TRUE(c) << c.error().what;
  EXPECT_GT(c->covered.count, 500);
  EXPECT_EQ(c->covered.max, 0);
  EXPECT_GT(c->partial, 10) << "the silhouette";
  EXPECT_GT(c->unlit, 10) << "past the terminator and the raster";
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    const Coverage coverage = view_.coverage.pixels()[i];
    EXPECT_EQ(std::isnan(c->de00.pixels()[i]),
              coverage == Coverage::kOutside || coverage == Coverage::kPartial);
  }
}

TEST_F(ComparisonTest, WhatGetsNoLightCountsAndIsInGamutWhereAmbientLightSuffices) {
  view_ = *bench_->look({}, {1, 0, 0.3});  // half round the sphere
  const Image<Rgb32f> dark = seen(Image<Rgb16>(64, 48, {0, 0, 0}));
  const auto good = bench_->compare(view_, dark, dark);
  ASSERT_TRUE(good) << good.error().what;
  EXPECT_GT(good->unlit, 100);
  EXPECT_GT(good->covered.count, good->unlit);
  EXPECT_EQ(good->in_gamut_fraction, 1.0);

  Image<Rgb32f> lighter = dark;
  for (Rgb32f& xyz : lighter.pixels()) xyz *= 1.5F;  // which a little of the lamp gives
  const auto c = bench_->compare(view_, lighter, dark);
  ASSERT_TRUE(c) << c.error().what;
  EXPECT_EQ(c->covered.count, good->covered.count);
  for (std::size_t i = 0; i < dark.pixels().size(); ++i) {
    if (view_.coverage.pixels()[i] != Coverage::kUnlit) continue;
    EXPECT_GT(c->de00.pixels()[i], 0) << i;
    EXPECT_EQ(c->in_gamut.pixels()[i], 0) << i;
  }
  EXPECT_LE(c->within_gamut.count, c->covered.count - c->unlit);
  EXPECT_GT(c->within_gamut.count, 0);
  EXPECT_EQ(c->in_gamut_fraction,
            static_cast<double>(c->within_gamut.count) / static_cast<double>(c->covered.count));
}

TEST_F(ComparisonTest, AMirroredFrameIsNoticed) {
  const auto c = bench_->compare(view_, seen(ramps(false)), seen(ramps(true)));
  ASSERT_TRUE(c) << c.error().what;
  EXPECT_GT(c->covered.mean, 10);
  EXPECT_LE(c->covered.mean, c->covered.p95);
  EXPECT_LE(c->covered.p95, c->covered.max);
}

TEST_F(ComparisonTest, TellsWhatIsOutOfGamut) {
  const Image<Rgb32f> picture = seen(Image<Rgb16>(64, 48, {200, 180, 160}));
  EXPECT_EQ(bench_->compare(view_, picture, picture)->in_gamut_fraction, 1.0);
  Image<Rgb32f> target = seen(Image<Rgb16>(64, 48, {255, 255, 255}));
  for (Rgb32f& xyz : target.pixels()) xyz *= 1.05F;
  const auto c = bench_->compare(view_, target, picture);
  ASSERT_TRUE(c) << c.error().what;
  EXPECT_EQ(c->in_gamut_fraction, 0.0);
  EXPECT_EQ(c->within_gamut.count, 0);
  EXPECT_GT(c->covered.mean, 1);
}

TEST_F(ComparisonTest, CountsWhatIsLighterThanWhite) {
  Image<Rgb32f> target(64, 48, Rgb32f(900, 1000, 900));
  const Image<Rgb32f> received(64, 48, Rgb32f(90, 100, 90));
  const auto c = bench_->compare(view_, target, received);
  ASSERT_TRUE(c) << c.error().what;
  EXPECT_EQ(c->target_over_white, c->covered.count);
  EXPECT_EQ(c->received_over_white, 0);
}

TEST_F(ComparisonTest, WhiteIsThatOfADiffuserAtTheObjectsOrigin) {
  const auto near = bench_->white({});
  ASSERT_TRUE(near);
  EXPECT_NEAR(near->y(), 800, 1e-9) << "at the reference; neither albedo nor ambient light count";
  RigidTransform far;
  far.translation.z() = -1;
  EXPECT_NEAR(bench_->white(far)->y(), 200, 1e-9);
  RigidTransform behind;
  behind.translation.z() = 1.5;
  EXPECT_FALSE(bench_->white(behind));
}

TEST_F(ComparisonTest, RefusesPicturesOfAnotherSizeOrNoNumbers) {
  const Image<Rgb32f> picture = seen(ramps(false));
  const auto size = bench_->compare(view_, picture, Image<Rgb32f>(63, 48));
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().code, Errc::kInvalidOption);
  Image<Rgb32f> broken(64, 48, Rgb32f::Constant(std::numeric_limits<float>::quiet_NaN()));
  const auto nan = bench_->compare(view_, broken, picture);
  ASSERT_FALSE(nan);
  EXPECT_EQ(nan.error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::simulation
