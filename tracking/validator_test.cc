// SPDX-License-Identifier: Apache-2.0
#include "tracking/validator.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using Verdict = Validator::Verdict;

PoseSample sample_at(int ms, const Eigen::Vector3d& position, double angle_rad = 0) {
  PoseSample sample;
  sample.time = Time{milliseconds(ms)};
  sample.world_from_body.translation = position;
  sample.world_from_body.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitY()));
  sample.epoch = 7;
  return sample;
}

TEST(Validator, BelievesWhatABodyCanDo) {
  Validator validator{{}};
  for (int i = 0; i < 500; ++i) {  // 9 m/s and 29 rad/s
    PoseSample sample = sample_at(4 * i, {0.036 * i, 0, 0}, 0.116 * i);
    if (i % 3 == 0) sample.world_from_body.rotation.coeffs() *= -1;  // the same rotation
    EXPECT_EQ(validator.check(sample), Verdict::kValid) << i;
    EXPECT_EQ(sample.epoch, 7U);
  }
}

TEST(Validator, OneWildSampleIsDroppedAndForgotten) {
  Validator validator{{}};
  for (int i = 0; i < 100; ++i) {
    const bool wild = i % 10 == 5;
    PoseSample sample = sample_at(4 * i, {wild ? 1.0 : 0.001 * i, 0, 0});
    EXPECT_EQ(validator.check(sample), wild ? Verdict::kOutlier : Verdict::kValid) << i;
    EXPECT_EQ(sample.epoch, 7U);
  }
}

TEST(Validator, TwoThatAgreeAreAJump) {
  Validator validator{{}};
  PoseSample sample = sample_at(0, {0, 0, 1});
  ASSERT_EQ(validator.check(sample), Verdict::kValid);
  sample = sample_at(4, {0, 0, -1});  // the mirrored hemisphere
  EXPECT_EQ(validator.check(sample), Verdict::kOutlier);
  sample = sample_at(8, {0, 0, -1.001});
  EXPECT_EQ(validator.check(sample), Verdict::kValid);
  EXPECT_EQ(sample.epoch, 8U);
  sample = sample_at(12, {0, 0, -1.002});
  EXPECT_EQ(validator.check(sample), Verdict::kValid);
  EXPECT_EQ(sample.epoch, 8U);
}

TEST(Validator, TwoThatDoNotAgreeAreNone) {
  Validator validator{{}};
  PoseSample sample = sample_at(0, {0, 0, 0});
  ASSERT_EQ(validator.check(sample), Verdict::kValid);
  for (int i = 1; i < 50; ++i) {
    sample = sample_at(4 * i, {10.0 * i, 0, 0});
    EXPECT_EQ(validator.check(sample), Verdict::kOutlier);
  }
  sample = sample_at(200, {0.5, 0, 0});
  EXPECT_EQ(validator.check(sample), Verdict::kValid);
}

TEST(Validator, TurnsAreHeldToTheirLimitToo) {
  Validator validator{{}};
  PoseSample sample = sample_at(0, {0, 0, 0});
  ASSERT_EQ(validator.check(sample), Verdict::kValid);
  sample = sample_at(4, {0, 0, 0}, std::numbers::pi);
  EXPECT_EQ(validator.check(sample), Verdict::kOutlier);
}

TEST(Validator, ALongAbsenceAllowsALongWay) {
  Validator validator{{}};
  PoseSample sample = sample_at(0, {0, 0, 0});
  ASSERT_EQ(validator.check(sample), Verdict::kValid);
  sample = sample_at(1000, {5, 0, 0});
  EXPECT_EQ(validator.check(sample), Verdict::kValid);
}

TEST(Validator, WhatIsNoPoseNeverPasses) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Validator validator{{}};
  PoseSample good = sample_at(0, {0, 0, 0});
  ASSERT_EQ(validator.check(good), Verdict::kValid);
  for (const double bad : {kNan, kInfinity, -kInfinity, 1e30, -1e30}) {
    for (int i = 0; i < 3; ++i) {
      PoseSample sample = sample_at(4, {0, 0, 0});
      sample.world_from_body.translation[i] = bad;
      EXPECT_EQ(validator.check(sample), Verdict::kInvalid);
    }
    for (int i = 0; i < 4; ++i) {
      PoseSample sample = sample_at(4, {0, 0, 0});
      sample.world_from_body.rotation.coeffs()[i] = bad;
      EXPECT_EQ(validator.check(sample), Verdict::kInvalid);
    }
  }
  for (const auto& [length, valid] : {std::pair{0.0, false},
                                      {5e-324, false},
                                      {0.5, false},
                                      {0.95, true},
                                      {1.05, true},
                                      {2.0, false}}) {
    PoseSample sample = sample_at(8, {0, 0, 0});
    sample.world_from_body.rotation.coeffs() *= length;
    EXPECT_EQ(validator.check(sample), valid ? Verdict::kValid : Verdict::kInvalid) << length;
  }
  PoseSample after = sample_at(12, {0.01, 0, 0});
  EXPECT_EQ(validator.check(after), Verdict::kValid) << "its state was changed";
}

TEST(Validator, OutsideTheBoxIsNowhere) {
  ValidationOptions options;
  options.least_m = Eigen::Vector3d(-1, -1, -1);
  options.most_m = Eigen::Vector3d(1, 1, 1);
  Validator validator(options);
  PoseSample sample = sample_at(0, {0, 0, 1.01});
  EXPECT_EQ(validator.check(sample), Verdict::kInvalid);
  sample = sample_at(4, {-1, 1, 1});
  EXPECT_EQ(validator.check(sample), Verdict::kValid);
}

TEST(ValidationOptions, RefusesWhatMakesNoSense) {
  for (const char* text : {"speed_m_s = 0",
                           "turn_rad_s = -1",
                           "tolerance_mm = -1",
                           "tolerance_deg = nan",
                           "least_m = [0, 0, 0]",
                           "least_m = [0, 0, 0]\nmost_m = [1, 0, 1]"}) {
    TomlReader toml = TomlReader::parse(text, "test").value();
    (void)ValidationOptions::read(toml);
    EXPECT_FALSE(toml.finish()) << text;
  }
}

}  // namespace
}  // namespace veneer::tracking
