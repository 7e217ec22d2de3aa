// SPDX-License-Identifier: Apache-2.0
#include "capture/session/bracket.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random.h"
#include "capture/session/watch.h"

namespace veneer::capture {
namespace {

constexpr std::uint16_t kFull = 4095;

/// Light from `dim` to `bright`, counts a second, on an offset.
CameraFrame frame_of(double exposure_s, double dim, double bright, double offset = 16) {
  CameraFrame frame;
  frame.full_scale = kFull;
  frame.exposure_s = exposure_s;
  frame.counts = Image<Rgb16>(32, 24);
  const auto pixels = static_cast<double>(frame.counts.pixels().size());
  double index = 0;
  for (Rgb16& pixel : frame.counts.pixels()) {
    const double light = dim * std::pow(bright / dim, index++ / (pixels - 1));
    const double counts = std::min(offset + light * exposure_s, static_cast<double>(kFull));
    pixel.fill(static_cast<std::uint16_t>(counts));
  }
  return frame;
}

double brightest(const CameraFrame& frame) {
  double most = 0;
  for (const Rgb16& pixel : frame.counts.pixels()) most = std::max<double>(most, pixel[0]);
  return most / kFull;
}

// Over nine decades of light and from any start: nothing is saturated, and the range is used,
// unless the camera's ends.
TEST(Bracket, ItsShortestExposureIsTheLongestWithoutSaturation) {
  const ExposureChoice choice{{1e-5, 10}, 0};
  ASSERT_TRUE(choice.check());
  for (double light = 1e-1; light < 1e9; light *= 7) {
    for (const double start : {1e-5, 0.01, 10.0}) {
      const auto found = longest_unsaturated(
          [light](double s) { return frame_of(s, light / 100, light); }, choice, start);
      ASSERT_TRUE(found);
      const double level = brightest(frame_of(found->exposure_s, light / 100, light));
      const bool darker = light * choice.range.most_s < 0.5 * kFull;
      const bool brighter = light * choice.range.least_s > 0.9 * kFull;
      EXPECT_EQ(found->reached, !brighter) << light << ", " << start;
      if (darker) {
        EXPECT_EQ(found->exposure_s, choice.range.most_s) << light << ", " << start;
      } else if (brighter) {
        EXPECT_EQ(found->exposure_s, choice.range.least_s) << light << ", " << start;
      } else {
        EXPECT_LT(level, 0.95) << light << ", " << start;
        EXPECT_GT(level, 0.4) << light << ", " << start;
      }
    }
  }
}

TEST(Bracket, ReachesTheDimTenthOrTheEndOfWhatIsAllowed) {
  const ExposureChoice choice{{1e-5, 10}, 0};
  for (double light = 1; light < 1e8; light *= 7) {
    const auto found = shortest_dim_enough(
        [light](double s) { return frame_of(s, light, light); }, choice, 1e-4, 5);
    ASSERT_TRUE(found);
    const double level = brightest(frame_of(found->exposure_s, light, light));
    EXPECT_EQ(found->reached, level >= kDimEnough) << light;
    if (light * 5 > kDimEnough * kFull) {
      EXPECT_GE(level, kDimEnough) << light;
      // Above that only where even the camera's shortest exposure is.
      EXPECT_TRUE(level < 2.1 * kDimEnough || found->exposure_s < 1.0001e-5) << light;
    } else {
      EXPECT_DOUBLE_EQ(found->exposure_s, 5) << light;
    }
  }
}

TEST(Bracket, KeepsToStepsMultiplesAndTheRange) {
  for (const double multiple : {0.0, 1.0 / 60, 0.25}) {
    for (const double step : {1.5, 4.0, 64.0}) {
      for (const int most : {1, 4, 12}) {
        ExposurePlan plan;
        plan.step = step;
        plan.most = most;
        plan.multiple_of_s = multiple;
        const ExposureChoice choice{{1e-4, 2}, multiple};
        ASSERT_TRUE(choice.check());
        const auto bracket = bracket_between(0.001, 1, plan, choice);
        ASSERT_FALSE(bracket.empty());
        EXPECT_LE(static_cast<int>(bracket.size()), most);
        for (std::size_t i = 0; i < bracket.size(); ++i) {
          EXPECT_GE(bracket[i], choice.range.least_s);
          EXPECT_LE(bracket[i], choice.range.most_s * (1 + 1e-12));
          if (multiple > 0) {
            EXPECT_NEAR(bracket[i] / multiple, std::round(bracket[i] / multiple), 1e-9);
            EXPECT_GE(bracket[i], multiple * (1 - 1e-12));
          }
          if (i > 0) {
            EXPECT_GT(bracket[i], bracket[i - 1]);
          }
        }
        // No exposure more than is needed.
        if (bracket.size() > 1) {
          EXPECT_LT(bracket[bracket.size() - 2], 1);
        }
      }
    }
  }
}

TEST(Bracket, RefusesWhatNoCameraCanDo) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE((ExposureChoice{{0.1, 0.01}, 0}.check()));
  EXPECT_FALSE((ExposureChoice{{nan, 1}, 0}.check()));
  EXPECT_FALSE((ExposureChoice{{0, infinity}, 0}.check()));
  EXPECT_FALSE((ExposureChoice{{0.001, 0.01}, 0.02}.check()));
  EXPECT_FALSE((ExposureChoice{{0.011, 0.019}, 0.01}.check()));
  EXPECT_TRUE((ExposureChoice{{0.011, 0.02}, 0.01}.check()));
}

CameraFrame noisy(std::uint64_t seed, int shift, double light) {
  Pcg32 random(seed);
  CameraFrame frame;
  frame.full_scale = kFull;
  frame.counts = Image<Rgb16>(48, 32);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 48; ++x) {
      const double board = ((x + shift) / 6 + y / 6) % 2 == 0 ? 400 : 2400;
      const double noise = (random.uniform() + random.uniform() + random.uniform() - 1.5) * 40;
      frame.counts(x, y).fill(static_cast<std::uint16_t>(board * light + noise + 60));
    }
  }
  return frame;
}

TEST(Watch, TellsMovementFromNoiseAndFromLight) {
  for (std::uint64_t seed = 1; seed < 40; ++seed) {
    const CameraFrame first = noisy(seed, 0, 1);
    const CameraFrame again = noisy(seed + 100, 0, 1);
    const auto still = change_since(first, again, noisy(seed + 200, 0, 1));
    ASSERT_TRUE(still);
    EXPECT_FALSE(still->moved()) << seed << ": " << still->movement;
    EXPECT_FALSE(still->light_changed()) << seed << ": " << still->light;
    const auto moved = change_since(first, again, noisy(seed + 200, 1, 1));
    ASSERT_TRUE(moved);
    EXPECT_TRUE(moved->moved()) << seed << ": " << moved->movement;
    const auto dimmed = change_since(first, again, noisy(seed + 200, 0, 0.97));
    ASSERT_TRUE(dimmed);
    EXPECT_FALSE(dimmed->moved()) << seed << ": " << dimmed->movement;
    EXPECT_TRUE(dimmed->light_changed()) << seed << ": " << dimmed->light;
  }
}

TEST(Watch, KnowsNothingOfBlackAndOfSaturatedPictures) {
  CameraFrame black;
  black.full_scale = kFull;
  black.counts = Image<Rgb16>(4, 4);
  CameraFrame full = black;
  for (Rgb16& pixel : full.counts.pixels()) pixel.fill(kFull);
  for (const CameraFrame& frame : {black, full}) {
    const auto change = change_since(frame, frame, frame);
    ASSERT_TRUE(change);
    EXPECT_FALSE(change->moved());
    EXPECT_FALSE(change->light_changed());
  }
  CameraFrame other = black;
  other.counts = Image<Rgb16>(4, 5);
  EXPECT_EQ(change_since(black, black, other).error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::capture
