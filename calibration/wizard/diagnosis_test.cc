// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/random.h"

namespace veneer::calibration {
namespace {

using Severity = Finding::Severity;
using testing::HasSubstr;

/// The levels that the wizard shows, of a projector of this tone curve and 500 cd/m^2.
GreyRamp ramp_of(const std::function<double(double)>& tone, double noise = 0, int seed = 1) {
  GreyRamp ramp;
  ramp.noise = std::max(noise, 1e-3);
  Pcg32 random(static_cast<std::uint64_t>(seed));
  for (const int code :
       {0, 2, 4, 8, 12, 16, 20, 24, 32, 48, 64, 96, 128, 160, 192, 216, 230, 236, 242, 249, 255}) {
    ramp.drive.push_back(code / 255.0);
    ramp.luminance.push_back(500 * tone(code / 255.0) * (1 + noise * random.normal()) +
                             0.003 * random.normal() * (noise > 0 ? 1 : 0));
  }
  ramp.luminance.front() = 0;
  return ramp;
}

double gamma22(double d) { return std::pow(d, 2.2); }
double limited_range(double d) { return gamma22(std::clamp((255 * d - 16) / 219, 0.0, 1.0)); }

TEST(DiagnoseRamp, FindsNothingWrongWithOrdinaryProjectors) {
  const auto s_curve = [](double d) { return 1.7 * std::pow(d, 2.5) / (std::pow(d, 2.3) + 0.7); };
  for (int seed = 0; seed < 200; ++seed) {
    for (const double noise : {0.0, 0.003, 0.01}) {
      for (const double exponent : {1.5, 1.8, 2.2, 2.6}) {
        const auto tone = [exponent](double d) { return std::pow(d, exponent); };
        EXPECT_TRUE(diagnose_ramp(ramp_of(tone, noise, seed)).empty())
            << exponent << " " << noise << " " << seed << ": "
            << diagnose_ramp(ramp_of(tone, noise, seed)).front().what;
      }
      EXPECT_TRUE(diagnose_ramp(ramp_of(s_curve, noise, seed)).empty()) << seed;
    }
  }
}

TEST(DiagnoseRamp, TellsALimitedRangeFromClippingAtOneEnd) {
  const auto what = [](const std::function<double(double)>& tone) {
    const auto findings = diagnose_ramp(ramp_of(tone, 0.003));
    return findings.empty() ? std::string("nothing") : findings.front().what;
  };
  EXPECT_THAT(what(limited_range), HasSubstr("limited range"));
  EXPECT_THAT(what([](double d) { return gamma22(std::min(1.0, 1.1 * d)); }),
              HasSubstr("as bright as white"));
  EXPECT_THAT(what([](double d) { return gamma22(std::max(0.0, (d - 0.09) / 0.91)); }),
              HasSubstr("no light at all"));
}

TEST(DiagnoseRamp, TellsAMissingAndADoubleGamma) {
  const auto linear = diagnose_ramp(ramp_of([](double d) { return d; }));
  ASSERT_EQ(linear.size(), 1U);
  EXPECT_EQ(linear.front().severity, Severity::kNote);
  EXPECT_THAT(linear.front().what, HasSubstr("gamma is off"));
  const auto steep = diagnose_ramp(ramp_of([](double d) { return std::pow(d, 4.4); }));
  ASSERT_FALSE(steep.empty());
  EXPECT_THAT(steep.back().what, HasSubstr("twice"));
  EXPECT_NEAR(effective_gamma(ramp_of(gamma22)), 2.2, 1e-9);
}

TEST(DiagnoseRamp, RefusesOneThatFalls) {
  const auto findings = diagnose_ramp(
      ramp_of([](double d) { return gamma22(d) * (d > 0.6 && d < 0.7 ? 0.5 : 1.0); }));
  ASSERT_FALSE(findings.empty());
  EXPECT_EQ(findings.front().severity, Severity::kFailure);
  EXPECT_THAT(findings.front().remedy, HasSubstr("dynamic contrast"));
}

TEST(DiagnoseRamp, StandsRampsThatSayNothing) {
  EXPECT_TRUE(diagnose_ramp({}).empty());
  GreyRamp dark = ramp_of(gamma22);
  for (double& y : dark.luminance) y = 0;
  EXPECT_TRUE(diagnose_ramp(dark).empty());
  EXPECT_TRUE(std::isnan(effective_gamma(dark)));
  EXPECT_TRUE(std::isnan(effective_gamma({})));
}

TEST(DiagnosePicture, TellsAWrongScreenFromADimOne) {
  const auto wrong = diagnose_picture({1.0, 1.1, 0.9}, {1.0, 1.102, 0.9}, 0.003);
  ASSERT_EQ(wrong.size(), 1U);
  EXPECT_EQ(wrong.front().severity, Severity::kFailure);
  EXPECT_THAT(wrong.front().remedy, HasSubstr("wrong screen"));
  const auto bright_room = diagnose_picture({40, 42, 30}, {120, 130, 100}, 0.003);
  ASSERT_EQ(bright_room.size(), 1U);
  EXPECT_EQ(bright_room.front().severity, Severity::kWarning);
  EXPECT_TRUE(diagnose_picture({0.5, 0.6, 0.7}, {400, 420, 500}, 0.003).empty());
  EXPECT_TRUE(diagnose_picture({0, 0, 0}, {400, 420, 500}, 0.003).empty());
}

TEST(WarmUp, DriftIsTheSlopeAndItsErrorIsHonest) {
  constexpr double kPerMinute = 0.004;
  int within = 0;
  constexpr int kRuns = 400;
  for (int run = 0; run < kRuns; ++run) {
    Pcg32 random(static_cast<std::uint64_t>(run));
    WarmUp readings;
    for (int i = 0; i <= 60; ++i) {
      readings.seconds.push_back(2.0 * i);
      readings.luminance.push_back(300 * (1 + kPerMinute * (2.0 * i - 90) / 60) *
                                   (1 + 0.003 * random.normal()));
    }
    const double off = drift_per_minute(readings, 60) - kPerMinute;
    if (std::abs(off) < drift_error_per_minute(readings, 60)) ++within;
  }
  // 68 % of normal deviates; the number of runs scatters by 9.
  EXPECT_NEAR(within, 0.68 * kRuns, 40);
}

TEST(WarmUp, TooFewReadingsAreNoDrift) {
  EXPECT_TRUE(std::isnan(drift_per_minute({}, 60)));
  EXPECT_TRUE(std::isnan(drift_per_minute({{0, 1}, {5, 5}}, 60)));
  EXPECT_TRUE(std::isnan(drift_per_minute({{3, 3, 3}, {5, 5, 5}}, 60)));  // all at one moment
  EXPECT_TRUE(std::isinf(drift_error_per_minute({{0, 1, 2}, {5, 5, 5}}, 60)));
  EXPECT_EQ(drift_per_minute({{0, 1, 2, 3}, {5, 5, 5, 5}}, 60), 0.0);
}

TEST(Repeatability, IsTheStandardDeviation) {
  Pcg32 random(3);
  std::vector<Xyz> readings;
  for (int i = 0; i < 20000; ++i)
    readings.emplace_back(100 * (1 + 0.01 * random.normal()),
                          200 * (1 + 0.01 * random.normal()),
                          50 * (1 + 0.01 * random.normal()));
  const Repeatability r = repeatability(readings);
  EXPECT_NEAR(r.relative, 0.01, 2e-4);
  EXPECT_NEAR(r.mean.y(), 200, 0.05);
  EXPECT_EQ(repeatability({}).relative, 0.0);
  EXPECT_EQ(repeatability(std::vector<Xyz>{Xyz(1, 2, 3)}).deviation, Xyz::Zero());
  EXPECT_EQ(repeatability(std::vector<Xyz>(3, Xyz::Zero())).relative, 0.0);
}

TEST(DiagnoseRoom, NoticesLightAndFlicker) {
  Repeatability white;
  white.mean = {400, 400, 400};
  Repeatability dark;
  dark.mean = {0.5, 0.5, 0.5};
  EXPECT_TRUE(diagnose_room(dark, white).empty());
  Repeatability bright;
  bright.mean = {20, 20, 20};
  bright.deviation = {2, 2, 2};
  const auto findings = diagnose_room(bright, white);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_THAT(findings[0].what, HasSubstr("5.0 % of white"));
  EXPECT_THAT(findings[1].what, HasSubstr("10.0 %"));
}

}  // namespace
}  // namespace veneer::calibration
