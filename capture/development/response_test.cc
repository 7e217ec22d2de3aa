// SPDX-License-Identifier: Apache-2.0
#include "capture/development/response.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "base/random.h"

namespace veneer::capture {
namespace {

TEST(ResponseCurve, LightAndCountsAreInverse) {
  for (const double gamma : {0.5, 1.0, 2.2}) {
    const ResponseCurve curve = ResponseCurve::gamma(gamma).value();
    for (double counts = 0; counts <= 1; counts += 0.01) {
      EXPECT_NEAR(curve.light(1, counts), std::pow(counts, gamma), gamma < 1 ? 0.02 : 1e-6);
      EXPECT_NEAR(curve.counts_fraction(1, curve.light(1, counts)), counts, 1e-9);
    }
    EXPECT_EQ(curve.linear(), gamma == 1);
  }
}

TEST(ResponseCurve, RefusesWhatIsNoCurve) {
  for (const double gamma : {0.0, -1.0, 11.0, std::nan("")})
    EXPECT_EQ(ResponseCurve::gamma(gamma).error().code, Errc::kInvalidOption) << gamma;
  const std::vector<double> good{0, 0.2, 1};
  for (const std::vector<double>& bad :
       {std::vector<double>{}, {0.5}, {0, 0.5, 0.5}, {0, 1, 0.9}, {0, std::nan(""), 1}})
    EXPECT_EQ(ResponseCurve::tabulated({good, bad, good}).error().code, Errc::kInvalidOption);
  EXPECT_TRUE(ResponseCurve::tabulated({good, good, good}));
}

TEST(ResponseCurve, IsCutToItsRange) {
  const ResponseCurve curve = ResponseCurve::gamma(2.2).value();
  EXPECT_EQ(curve.light(0, -1), 0);
  EXPECT_EQ(curve.light(0, std::nan("")), 0);
  EXPECT_EQ(curve.light(0, 2), 1);
  EXPECT_EQ(curve.counts_fraction(0, -1), 0);
  EXPECT_EQ(curve.counts_fraction(0, 7), 1);
  EXPECT_GT(curve.slope(0, 0), 0);
  EXPECT_GT(curve.slope(0, 1), 2);
}

/// A bracket through a camera of 12 bits whose counts are `encode(light)`, with shot and read
/// noise.
std::vector<Picture> bracket_through(const std::function<double(double)>& encode,
                                     double offset = 0) {
  std::vector<Picture> bracket;
  Pcg32 random(7);
  for (const bool dark : {false, true}) {
    for (int exposure = 0; exposure < 5; ++exposure) {
      Picture picture;
      picture.counts = Image<Rgb32f>(120, 90);
      picture.full_scale = 4095;
      picture.exposure_s = 0.01 * std::pow(2.0, exposure);
      picture.shot.dark = dark;
      picture.shot.exposure = exposure;
      for (int i = 0; i < 120 * 90; ++i) {
        const double scene = 0.3 * std::pow(10.0, -2.0 * (i % 1000) / 1000) * std::pow(2, exposure);
        for (int channel = 0; channel < 3; ++channel) {
          const double electrons = 20000 * (dark ? 0 : scene);
          const double noisy =
              (electrons + std::sqrt(electrons + 16) * random.normal()) / 20000 + offset;
          picture.counts.pixels()[static_cast<std::size_t>(i)][channel] =
              static_cast<float>(std::round(4095 * encode(std::clamp(noisy, 0.0, 1.0))));
        }
      }
      bracket.push_back(picture);
    }
  }
  return bracket;
}
double worst_light(const ResponseCurve& curve, const std::function<double(double)>& encode) {
  double worst = 0;
  for (double light = 0; light <= 1; light += 0.01)
    for (int channel = 0; channel < 3; ++channel)
      worst = std::max(worst, std::abs(curve.light(channel, encode(light)) - light));
  return worst;
}

TEST(RecoveredResponse, IsTheOneThatTheBracketWentThrough) {
  const std::vector<std::pair<const char*, std::function<double(double)>>> cameras{
      {"linear", [](double light) { return light; }},
      {"gamma", [](double light) { return std::pow(light, 1 / 2.2); }},
      {"s-shaped", [](double light) {
         return (std::atan(3 * (std::sqrt(light) - 0.45)) + std::atan(1.35)) /
                (std::atan(1.65) + std::atan(1.35));
       }}};
  for (const auto& [name, encode] : cameras) {
    for (const ResponseMethod method : {ResponseMethod::kDebevec, ResponseMethod::kRobertson}) {
      const auto recovered = recover_response(bracket_through(encode), method);
      ASSERT_TRUE(recovered) << recovered.error().what;
      EXPECT_LT(worst_light(recovered->curve, encode),
                std::string(name) == "s-shaped" ? 0.05 : 0.01)
          << name;
      EXPECT_LT(recovered->residual, 0.01) << name;
      if (std::string(name) != "linear") {
        EXPECT_GT(recovered->residual_if_linear, 5 * recovered->residual) << name;
      } else {
        EXPECT_LT(recovered->residual_if_linear, 1.1 * recovered->residual) << name;
      }
    }
  }
}

TEST(RecoveredResponse, RefusesWhatIsNoBracket) {
  const auto linear = [](double light) { return light; };
  const std::vector<Picture> bracket = bracket_through(linear);
  const auto code = [](const std::vector<Picture>& pictures) {
    const auto recovered = recover_response(pictures, ResponseMethod::kDebevec);
    return recovered ? Errc::kCancelled : recovered.error().code;
  };
  EXPECT_EQ(code({}), Errc::kInvalidOption);
  EXPECT_EQ(code({bracket[0], bracket[1]}), Errc::kInvalidOption);
  EXPECT_EQ(code({bracket[0], bracket[1], bracket[1]}), Errc::kInvalidOption);
  std::vector<Picture> other = bracket;
  other[1].counts = Image<Rgb32f>(5, 5);
  EXPECT_EQ(code(other), Errc::kInvalidOption);
  other = bracket;
  other[2].counts(1, 1)[0] = std::nanf("");
  EXPECT_EQ(code(other), Errc::kInvalidOption);
  other = bracket;
  other[2].exposure_s = 0;
  EXPECT_EQ(code(other), Errc::kInvalidOption);
  // Nothing brighter than a fifth of the range.
  EXPECT_EQ(code(bracket_through([](double light) { return 0.2 * light; })), Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::capture
