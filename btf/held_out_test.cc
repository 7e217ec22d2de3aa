// SPDX-License-Identifier: Apache-2.0
#include "btf/held_out.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <utility>

#include "btf/internal_test_sets.h"
#include "btf/spread_texels.h"

namespace veneer::btf {
namespace {

using ::testing::HasSubstr;

constexpr double kSixty_rad = std::numbers::pi / 3.0;
constexpr int kAllTexels = 1 << 20;
// Sums of a few thousand numbers up to 1 in double precision, and a root or a power.
constexpr double kDouble = 1e-12;

// Polar angles of its views are 0, 30, 60, 60, 75 and 89 degrees, not in order.
SampleSetInfo small_info(int channels = 3) {
  SampleSetInfo info;
  info.width = 7;
  info.height = 3;
  info.polarised = channels == 6;
  for (const auto& [theta_deg, phi] : {std::pair{75.0, 1.0},
                                       std::pair{0.0, 0.0},
                                       std::pair{60.0, 0.1},
                                       std::pair{89.0, 2.0},
                                       std::pair{30.0, 5.0},
                                       std::pair{60.0, 4.0}})
    info.views.push_back(direction_from_angles({theta_deg * std::numbers::pi / 180.0, phi}));
  info.lights = {
      Direction::UnitZ(), direction_from_angles({0.7, 2.0}), direction_from_angles({1.5, 4.0})};
  return info;
}
constexpr int kWithin = 4;  // of these views
constexpr int kBeyond = 2;

// Exact in float16.
float pattern(int texel, int view, int light, int channel) {
  return 0.125F + 0.03125F * static_cast<float>((3 * texel + 2 * view + 5 * light + channel) % 17);
}

int number_of(const DirectionSet& set, const Direction& wanted) {
  const auto found =
      std::ranges::find_if(set, [&](const Direction& d) { return (d - wanted).norm() < 1e-9; });
  return static_cast<int>(found - set.begin());
}

// Draws what a function says of (texel, view, light, channel).
class DrawnMaterial final : public Material {
 public:
  using Draw = std::function<double(int, int, int, int)>;
  DrawnMaterial(SampleSetInfo info, Draw draw) : info_(std::move(info)), draw_(std::move(draw)) {}
  std::string_view model() const override { return "drawn"; }
  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  const DirectionSet& views() const override { return info_.views; }
  const DirectionSet& lights() const override { return info_.lights; }
  void reconstruct(int, std::span<float> rgb) const override { std::ranges::fill(rgb, 0.0F); }
  Eigen::Vector3d radiance(int texel,
                           const Direction& view,
                           const Direction& light) const override {
    const int v = number_of(info_.views, view);
    const int l = number_of(info_.lights, light);
    return {draw_(texel, v, l, 0), draw_(texel, v, l, 1), draw_(texel, v, l, 2)};
  }
  double values_per_texel() const override { return 0.0; }
  ModelShader shader() const override { return {}; }
  Contents contents() const override { return {}; }

 private:
  SampleSetInfo info_;
  Draw draw_;
};

class HeldOut : public ::testing::Test {
 protected:
  Result<HeldOutErrors> errors(DrawnMaterial::Draw draw, int texels = kAllTexels) {
    return held_out_errors(
        set_, DrawnMaterial(small_info(), std::move(draw)), kSixty_rad, texels, silent_);
  }
  Result<SampleSet> near(double degrees) {
    return without_views_beyond(
        set_, degrees * std::numbers::pi / 180.0, folder_.path() / "near.btfset");
  }
  TemporaryFolder folder_;
  SilentProgress silent_;
  SampleSet set_ = testing::make_set(folder_.path() / "a.btfset", small_info(), pattern);
};

TEST_F(HeldOut, TheNearSetHasTheSamplesOfTheWholeOne) {
  for (const int channels : {3, 6}) {
    SampleSetInfo info = small_info(channels);
    info.scale = 4.0;
    const SampleSet whole = testing::make_set(folder_.path() / "whole.btfset", info, pattern);
    const auto near = without_views_beyond(whole, kSixty_rad, folder_.path() / "without.btfset");
    ASSERT_TRUE(near) << near.error().what;
    ASSERT_EQ(near->info().views.size(), kWithin);
    EXPECT_EQ(near->info().lights.size(), info.lights.size());
    EXPECT_EQ(near->info().scale, info.scale);
    EXPECT_EQ(near->info().polarised, info.polarised);
    const std::size_t row = info.lights.size() * static_cast<std::size_t>(channels);
    for (int texel = 0; texel < info.texel_count(); ++texel)
      for (std::size_t view = 0; view < near->info().views.size(); ++view) {
        const auto of_whole =
            static_cast<std::size_t>(number_of(info.views, near->info().views[view]));
        ASSERT_LT(of_whole, info.views.size());
        EXPECT_TRUE(std::ranges::equal(near->stored(texel).subspan(view * row, row),
                                       whole.stored(texel).subspan(of_whole * row, row)))
            << "texel " << texel << ", view " << of_whole;
      }
  }
}

TEST_F(HeldOut, AViewAtTheAngleIsFittedAndOneJustBeyondIsNot) {
  // 60 degrees went through a file and back.
  EXPECT_EQ(near(60.0)->info().views.size(), kWithin);
  EXPECT_EQ(near(60.0 - 1e-6)->info().views.size(), 2U);
  EXPECT_EQ(near(60.0 + 1e-6)->info().views.size(), kWithin);
  EXPECT_EQ(near(0.0)->info().views.size(), 1U);
}

TEST_F(HeldOut, RefusesAnglesThatLeaveAllViewsOnOneSide) {
  for (const double degrees : {89.0, 90.0}) {
    const auto all = near(degrees);
    ASSERT_FALSE(all.has_value()) << degrees;
    EXPECT_EQ(all.error().code, Errc::kInvalidOption);
    EXPECT_THAT(all.error().what, HasSubstr("the furthest from the normal is at 89;"));
  }
  SampleSetInfo grazing = small_info();
  grazing.views.erase(grazing.views.begin() + 1);
  const SampleSet set = testing::make_set(folder_.path() / "grazing.btfset", grazing, pattern);
  const auto none = without_views_beyond(set, 0.1, folder_.path() / "none.btfset");
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, Errc::kInvalidOption);
  EXPECT_THAT(none.error().what, HasSubstr("the nearest to the normal is at 30;"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "none.btfset"));
}

TEST_F(HeldOut, RefusesAnglesThatAreNone) {
  for (const double degrees :
       {-1e-9, 90.001, std::nan(""), std::numeric_limits<double>::infinity()}) {
    const auto refused = near(degrees);
    ASSERT_FALSE(refused.has_value()) << degrees;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_THAT(refused.error().what, HasSubstr("between 0 and 90 degrees"));
  }
}

TEST_F(HeldOut, AMaterialThatGivesTheSetBackHasNoError) {
  const auto result = errors(pattern);
  ASSERT_TRUE(result) << result.error().what;
  EXPECT_EQ(result->texels, small_info().texel_count());
  EXPECT_EQ(result->within.views, kWithin);
  EXPECT_EQ(result->beyond.views, kBeyond);
  for (const ViewsError& error : {result->within, result->beyond}) {
    EXPECT_EQ(error.rmse, 0.0);
    EXPECT_EQ(error.epsilon, 0.0);
  }
}

// The sums by themselves: nothing of held_out.cc is used to find them.
TEST_F(HeldOut, TheErrorOfAConstantMaterialIsThatOfTheSumsByHand) {
  constexpr double kConstant = 0.3;
  const auto result = errors([](int, int, int, int) { return kConstant; });
  ASSERT_TRUE(result) << result.error().what;
  const SampleSetInfo info = small_info();
  for (const bool beyond : {false, true}) {
    double squares = 0.0;
    double encoded = 0.0;
    double count = 0.0;
    for (int texel = 0; texel < info.texel_count(); ++texel)
      for (int view = 0; view < 6; ++view)
        for (int light = 0; light < 3; ++light)
          for (int channel = 0; channel < 3; ++channel) {
            if ((view == 0 || view == 3) != beyond) continue;
            const double sample = double(pattern(texel, view, light, channel));
            squares += std::pow(sample - kConstant, 2.0);
            encoded += std::abs(std::pow(sample, 1.0 / 2.2) - std::pow(kConstant, 1.0 / 2.2));
            count += 1.0;
          }
    const ViewsError& error = beyond ? result->beyond : result->within;
    EXPECT_NEAR(error.rmse, std::sqrt(squares / count), kDouble);
    EXPECT_NEAR(error.epsilon, encoded / count, kDouble);
  }
}

TEST_F(HeldOut, EachSideHasTheErrorOfItsOwnViews) {
  constexpr double kOff = 0.0625;
  const auto far_off = errors([](int texel, int view, int light, int channel) {
    const bool beyond = view == 0 || view == 3;
    return double(pattern(texel, view, light, channel)) + (beyond ? kOff : 0.0);
  });
  ASSERT_TRUE(far_off) << far_off.error().what;
  EXPECT_EQ(far_off->within.rmse, 0.0);
  EXPECT_NEAR(far_off->beyond.rmse, kOff, kDouble);
}

TEST_F(HeldOut, BothSidesAreCutToOne) {
  const SampleSet bright = testing::make_set(
      folder_.path() / "bright.btfset", small_info(), [](int, int, int, int) { return 8.0F; });
  const DrawnMaterial brighter(small_info(), [](int, int, int, int) { return 1e6; });
  const DrawnMaterial below(small_info(), [](int, int, int, int) { return -3.0; });
  const auto same = held_out_errors(bright, brighter, kSixty_rad, kAllTexels, silent_);
  ASSERT_TRUE(same) << same.error().what;
  EXPECT_EQ(same->beyond.rmse, 0.0);
  const auto most = held_out_errors(bright, below, kSixty_rad, kAllTexels, silent_);
  ASSERT_TRUE(most) << most.error().what;
  EXPECT_NEAR(most->beyond.rmse, 1.0, kDouble);
  EXPECT_NEAR(most->beyond.epsilon, 1.0, kDouble);
}

TEST_F(HeldOut, SomeTexelsStandForAll) {
  constexpr int kSome = 5;
  const std::vector<int> chosen = spread_texels(small_info(), kSome);
  ASSERT_EQ(chosen.size(), kSome);
  const auto result = errors(
      [&](int texel, int view, int light, int channel) {
        EXPECT_TRUE(std::ranges::count(chosen, texel)) << texel;
        return double(pattern(texel, view, light, channel));
      },
      kSome);
  ASSERT_TRUE(result) << result.error().what;
  EXPECT_EQ(result->texels, kSome);
  EXPECT_FALSE(errors(pattern, 0).has_value());
}

TEST_F(HeldOut, RefusesMaterialsOfAnotherSize) {
  SampleSetInfo wider = small_info();
  ++wider.width;
  const auto refused =
      held_out_errors(set_, DrawnMaterial(wider, pattern), kSixty_rad, kAllTexels, silent_);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_THAT(refused.error().what, HasSubstr("8 x 3 texels, the set 7 x 3"));
}

TEST_F(HeldOut, RefusesWhatIsNotFinite) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    const auto drawn = errors(
        [bad](int texel, int view, int, int) { return texel == 11 && view == 3 ? bad : 0.5; });
    ASSERT_FALSE(drawn.has_value()) << bad;
    EXPECT_EQ(drawn.error().code, Errc::kBadFormat);
    EXPECT_THAT(drawn.error().what, HasSubstr("texel 11 "));
  }
}

TEST(SpreadTexels, AreAllInOrderWhereAllAreWantedAndElseWithinTheSample) {
  SampleSetInfo info;
  info.width = 64;
  info.height = 48;
  const std::vector<int> all = spread_texels(info, 64 * 48);
  ASSERT_EQ(all.size(), 64U * 48U);
  EXPECT_TRUE(std::ranges::is_sorted(all));
  EXPECT_EQ(all.back(), 64 * 48 - 1);
  // A quarter of the texels meets each quarter of the sample alike: of a sequence of low
  // discrepancy the counts differ by little from 192.
  std::array<int, 4> quarters{};
  for (const int texel : spread_texels(info, 64 * 48 / 4)) {
    ASSERT_GE(texel, 0);
    ASSERT_LT(texel, 64 * 48);
    ++quarters[static_cast<std::size_t>((texel % 64 >= 32 ? 1 : 0) + (texel / 64 >= 24 ? 2 : 0))];
  }
  for (const int count : quarters) EXPECT_NEAR(count, 192, 8);
}

}  // namespace
}  // namespace veneer::btf
