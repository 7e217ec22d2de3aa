// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/decoding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace veneer::geometry {
namespace {

constexpr int kCameraWidth = 150;
constexpr int kCameraHeight = 110;

/// A camera that sees the raster enlarged, so that a camera pixel's middle lights up from a known
/// projector pixel.
struct Scene {
  double camera_pixels = 2.2;  // along the side of a projector pixel
  double ambient = 300;        // counts
  double light = 8000;         // counts of white on a bright surface, ambient apart
  double noise = 0;            // counts
  double indirect = 0.0;       // of the mean light of the picture, everywhere
  double blur = 0;             // projector pixels, half the width of a box
  double gamma = 1;            // of the projector, not undone
  bool dark_half = false;      // the right half reflects 1 % of the rest
  bool shadow = false;         // the top quarter sees no projector, only what is scattered

  [[nodiscard]] Eigen::Vector2d projector_at(int x, int y) const {
    return {(x + 0.5) / camera_pixels, (y + 0.5) / camera_pixels};
  }
  [[nodiscard]] GreyPicture picture(const PatternPlan& plan, int index, Pcg32& random) const {
    GreyPicture result(kCameraWidth, kCameraHeight);
    double mean = 0;
    for (int y = 0; y < plan.height; ++y)
      for (int x = 0; x < plan.width; ++x)
        mean += output(plan, index, x, y) / (plan.width * plan.height);
    for (int y = 0; y < kCameraHeight; ++y) {
      for (int x = 0; x < kCameraWidth; ++x) {
        const Eigen::Vector2d at = projector_at(x, y);
        const int reach = static_cast<int>(std::ceil(blur));
        double level = 0;
        double weights = 0;
        for (int dy = -reach; dy <= reach; ++dy) {
          for (int dx = -reach; dx <= reach; ++dx) {
            const int u = std::clamp(static_cast<int>(at.x()) + dx, 0, plan.width - 1);
            const int v = std::clamp(static_cast<int>(at.y()) + dy, 0, plan.height - 1);
            level += output(plan, index, u, v);
            weights += 1;
          }
        }
        level /= weights;
        if (shadow && y < kCameraHeight / 4) level = 0;
        const double reflectance = dark_half && x >= kCameraWidth / 2 ? 0.01 : 1;
        const double counts =
            ambient + reflectance * light * (level + indirect * mean) + noise * random.normal();
        result(x, y) = static_cast<std::uint16_t>(std::clamp(std::round(counts), 0.0, 65535.0));
      }
    }
    return result;
  }
  [[nodiscard]] double output(const PatternPlan& plan, int index, int x, int y) const {
    return std::pow(pattern_level(plan, index, x, y), gamma);
  }
  [[nodiscard]] std::vector<GreyPicture> pictures(const PatternPlan& plan) const {
    Pcg32 random(5);
    std::vector<GreyPicture> all;
    for (int i = 0; i < plan.pictures(); ++i) all.push_back(picture(plan, i, random));
    return all;
  }
};

/// Distances of the decoded positions from the truth, largest first axis; NaN where not decoded.
std::vector<double> errors_of(const Scene& scene, const DecodedView& view, auto&& use) {
  std::vector<double> errors;
  for (int y = 0; y < kCameraHeight; ++y) {
    for (int x = 0; x < kCameraWidth; ++x) {
      if (!use(x, y) || !view.projector(x, y).allFinite()) continue;
      const Eigen::Vector2f& seen = view.projector(x, y);
      const Eigen::Vector2d at = scene.projector_at(x, y);
      errors.push_back(std::max(std::abs(seen.x() - at.x()), std::abs(seen.y() - at.y())));
    }
  }
  return errors;
}
constexpr auto everywhere = [](int, int) { return true; };

TEST(Decoding, GivesTheMiddleOfTheBlock) {
  for (const int step : {1, 2, 3}) {
    const PatternPlan plan = gray_code_plan(69, 51, step).value();
    const Scene scene;
    const DecodedView view = decode(scene.pictures(plan), plan).value();
    EXPECT_EQ(view.decoded_ratio, 1);
    EXPECT_EQ(view.lit_ratio, 1);
    for (int y = 0; y < kCameraHeight; ++y) {
      for (int x = 0; x < kCameraWidth; ++x) {
        const Eigen::Vector2d at = scene.projector_at(x, y);
        const int code = static_cast<int>(at.x()) / step;
        // First pixel centre at one half: code 0 of blocks of one pixel is 0.5.
        ASSERT_FLOAT_EQ(view.projector(x, y).x(), static_cast<float>(step * code + 0.5 * step));
      }
    }
  }
}

TEST(Decoding, HoldsWithNoiseAmbientGammaAndScatteredLight) {
  Scene scene;
  scene.ambient = 5000;
  scene.noise = 200;
  scene.gamma = 2.2;
  scene.indirect = 0.5;
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  const DecodedView view = decode(scene.pictures(plan), plan).value();
  EXPECT_GT(view.decoded_ratio, 0.999);
  // 200 counts, and the spread of an estimate from the inner 80 % of some thousand pixels.
  EXPECT_NEAR(view.noise_counts, 200, 20);
  const std::vector<double> errors = errors_of(scene, view, everywhere);
  EXPECT_LE(*std::ranges::max_element(errors), 0.5 + 1e-6);
}

TEST(Decoding, TakesTheBorderWhereABlurredBitIsUnsure) {
  Scene scene;
  scene.blur = 2;  // of five pixels: the finest stripes, two wide, lose most of their contrast
  scene.noise = 20;
  const PatternPlan plan = gray_code_plan(69, 51, 2).value();
  const DecodedView view = decode(scene.pictures(plan), plan).value();
  EXPECT_GT(view.decoded_ratio, 0.9);
  const auto inside = [](int x, int y) {  // where the box is whole
    return x > 12 && y > 12 && x < kCameraWidth - 12 && y < kCameraHeight - 12;
  };
  const std::vector<double> errors = errors_of(scene, view, inside);
  // A block and, by the blur, one neighbour.
  EXPECT_LE(*std::ranges::max_element(errors), 4);
}

TEST(Decoding, LeavesOutWhatIsDarkOrInShadow) {
  Scene scene;
  scene.noise = 30;
  scene.dark_half = true;
  scene.shadow = true;
  scene.indirect = 0.2;
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  const DecodedView view = decode(scene.pictures(plan), plan).value();
  // Bright and not in shadow: half of three quarters of the picture, rounded up to whole rows.
  EXPECT_NEAR(view.lit_ratio, 0.375, 0.01);
  EXPECT_GT(view.decoded_ratio, 0.999);
  for (int x = 0; x < kCameraWidth; ++x) {
    EXPECT_FALSE(view.projector(x, 3).allFinite()) << x;
    EXPECT_EQ(view.confidence(x, 3), 0) << x;
  }
}

TEST(Decoding, IsTheSameInEightBitsAndInSixteen) {
  Scene scene;
  scene.ambient = 10;
  scene.light = 200;
  scene.noise = 2;
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  const std::vector<GreyPicture> small = scene.pictures(plan);
  std::vector<GreyPicture> large = small;
  for (GreyPicture& picture : large)
    for (std::uint16_t& count : picture.pixels()) count *= 257;
  const DecodedView a = decode(small, plan).value();
  const DecodedView b = decode(large, plan).value();
  EXPECT_NEAR(b.noise_counts, 257 * a.noise_counts, 1e-6 * b.noise_counts);
  EXPECT_EQ(a.decoded_ratio, b.decoded_ratio);
  EXPECT_GT(a.decoded_ratio, 0.999);
}

TEST(Decoding, IsLessConfidentWhereThereIsMoreNoise) {
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  double before = 2;
  for (const double noise : {0.0, 100.0, 400.0}) {
    Scene scene;
    scene.noise = noise;
    const DecodedView view = decode(scene.pictures(plan), plan).value();
    double sum = 0;
    for (const float each : view.confidence.pixels()) sum += each;
    const double mean = sum / static_cast<double>(view.confidence.pixels().size());
    EXPECT_LT(mean, before) << noise;
    before = mean;
  }
}

TEST(Decoding, PointsToThePictureThatWasTakenWrongly) {
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  std::vector<GreyPicture> pictures = Scene{}.pictures(plan);
  pictures[4] = pictures[5];  // the inverse twice
  const DecodedView view = decode(pictures, plan).value();
  EXPECT_EQ(view.pattern_ratio[4], 0);
  EXPECT_EQ(view.pattern_ratio[2], 1);
}

TEST(PhaseShift, IsBelowAPixelWithNoiseAndGamma) {
  Scene scene;
  scene.noise = 80;  // 1 % of white
  for (const auto& [gamma, bound] : {std::pair{1.0, 0.12}, {2.2, 0.35}}) {
    scene.gamma = gamma;
    const PatternPlan plan = phase_shift_plan(69, 51, 16, 8).value();
    const DecodedView view = decode(scene.pictures(plan), plan).value();
    EXPECT_GT(view.decoded_ratio, 0.999);
    double squares = 0;
    int count = 0;
    for (int y = 0; y < kCameraHeight; ++y) {
      for (int x = 0; x < kCameraWidth; ++x) {
        // A projector pixel is uniform, so that its middle is what can be told.
        const Eigen::Vector2d middle =
            scene.projector_at(x, y).array().floor().matrix() + Eigen::Vector2d(0.5, 0.5);
        const Eigen::Vector2f& seen = view.projector(x, y);
        if (!seen.allFinite()) continue;
        squares += (seen - middle.cast<float>()).squaredNorm() / 2;
        ++count;
      }
    }
    // Deviation of a phase, in pixels: period / 2 pi * noise / amplitude * sqrt(2 / shifts) = 0.03;
    // the bound leaves room for what noise does to amplitude where gamma lowers it.
    EXPECT_LT(std::sqrt(squares / count), bound) << gamma;
  }
}

TEST(Decoding, RefusesWhatIsNoSequence) {
  const PatternPlan plan = gray_code_plan(69, 51, 1).value();
  std::vector<GreyPicture> pictures = Scene{}.pictures(plan);
  std::vector<GreyPicture> few(pictures.begin(), pictures.end() - 1);
  auto refused = decode(few, plan);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  EXPECT_NE(refused.error().what.find("27 pictures where the sequence has 28"), std::string::npos)
      << refused.error().what;
  EXPECT_EQ(decode({}, plan).error().code, Errc::kInvalidOption);

  std::vector<GreyPicture> mixed = pictures;
  mixed[7] = GreyPicture(20, 20);
  refused = decode(mixed, plan);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("picture 7"), std::string::npos) << refused.error().what;

  const std::vector<GreyPicture> dark(pictures.size(), pictures.back());
  refused = decode(dark, plan);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);

  EXPECT_EQ(decode(pictures, plan, {.least_deviations = 0}).error().code, Errc::kInvalidOption);
  EXPECT_EQ(decode(pictures, plan, {.least_contrast = 1}).error().code, Errc::kInvalidOption);
  EXPECT_EQ(decode(pictures, plan, {.least_lit = NAN}).error().code, Errc::kInvalidOption);
}

}  // namespace
}  // namespace veneer::geometry
