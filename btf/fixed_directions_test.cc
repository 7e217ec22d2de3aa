// SPDX-License-Identifier: Apache-2.0
#include "btf/fixed_directions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "btf/interpolated_set.h"
#include "btf/models/internal_test_models.h"

namespace veneer::btf {
namespace {

using testing::dichromatic_set;
using testing::make_set;
using testing::random_direction;
using testing::small_info;

constexpr double kDegree = std::numbers::pi / 180.0;

class FixedDirectionsTest : public ::testing::Test {
 protected:
  [[nodiscard]] Result<SampleSet> fix(const FixedDirections& fixed, const char* name) {
    SilentProgress progress;
    return fix_directions(set_, fixed, folder_.path() / name, progress);
  }
  TemporaryFolder folder_;
  SampleSet set_ = dichromatic_set(folder_.path() / "all.btfset", true);
};

// A measured direction keeps its very samples, of every channel.
TEST_F(FixedDirectionsTest, AMeasuredDirectionGivesItsOwnSamples) {
  const SampleSetInfo& info = set_.info();
  const auto channels = static_cast<std::size_t>(info.channel_count());
  for (const std::size_t fixed : {std::size_t{0}, std::size_t{3}}) {
    const auto seen = fix({info.views[fixed], {}}, fixed == 0 ? "v0" : "v3");
    const auto lit = fix({{}, info.lights[fixed]}, fixed == 0 ? "l0" : "l3");
    ASSERT_TRUE(seen) << seen.error().what;
    ASSERT_TRUE(lit) << lit.error().what;
    ASSERT_EQ(seen->info().views, DirectionSet{info.views[fixed]});
    ASSERT_EQ(seen->info().lights, info.lights);
    ASSERT_EQ(lit->info().lights, DirectionSet{info.lights[fixed]});
    ASSERT_TRUE(seen->info().polarised);
    for (int texel = 0; texel < info.texel_count(); ++texel) {
      const auto all = set_.stored(texel);
      const std::size_t row = info.lights.size() * channels;
      EXPECT_TRUE(std::ranges::equal(seen->stored(texel), all.subspan(fixed * row, row)));
      for (std::size_t view = 0; view < info.views.size(); ++view)
        EXPECT_TRUE(std::ranges::equal(lit->stored(texel).subspan(view * channels, channels),
                                       all.subspan(view * row + fixed * channels, channels)));
    }
  }
}

// Between the measured directions, the interpolated set is the reference.
TEST_F(FixedDirectionsTest, BetweenDirectionsItIsTheInterpolatedSet) {
  const InterpolatedSet reference(set_);
  Pcg32 random(2);
  for (int i = 0; i < 8; ++i) {
    // Within the ring of measured views, whose chords are a third nearer.
    const Direction view = random_direction(random, std::cos(0.6));
    const Direction light = random_direction(random, std::cos(0.6));
    const auto fixed = fix({view, light}, fmt::format("{}", i).c_str());
    ASSERT_TRUE(fixed) << fixed.error().what;
    ASSERT_EQ(fixed->info().pair_count(), 1);
    for (int texel = 0; texel < set_.info().texel_count(); ++texel) {
      std::array<float, 3> rgb{};
      fixed->rgb(texel, Part::kTotal, rgb);
      const Eigen::Vector3d wanted = reference.radiance(texel, view, light);
      for (Eigen::Index c = 0; c < 3; ++c)
        EXPECT_NEAR(double(rgb[static_cast<std::size_t>(c)]), wanted[c], 2e-3);  // two halves' sum
    }
  }
}

// The fit of a fixed set is the fit of a set that has just this view.
TEST_F(FixedDirectionsTest, ModelsFitItAsASetOfOneView) {
  SampleSetInfo info = set_.info();
  const DirectionSet all = info.views;
  constexpr int kView = 2;
  info.views = {all[kView]};
  const SampleSetInfo whole = set_.info();
  const SampleSet alone =
      make_set(folder_.path() / "alone.btfset", info, [&](int texel, int, int light, int channel) {
        return testing::dichromatic(whole, texel, kView, light, channel);
      });
  const auto fixed = fix({all[kView], {}}, "fixed.btfset");
  ASSERT_TRUE(fixed) << fixed.error().what;
  Pcg32 random(7);
  for (const Model& model : models()) {
    SCOPED_TRACE(model.name);
    const FitOptions options = testing::options_with(testing::components_of(model, "2", "1+1"));
    const auto a = testing::fit(model.name, *fixed, options);
    const auto b = testing::fit(model.name, alone, options);
    ASSERT_EQ(bool(a), bool(b));
    if (!a) continue;
    EXPECT_EQ((*a)->values_per_texel(), (*b)->values_per_texel());
    EXPECT_EQ((*a)->shader().gpu_bytes(), (*b)->shader().gpu_bytes());
    for (int i = 0; i < 20; ++i) {
      const Direction view = random_direction(random);
      const Direction light = random_direction(random);
      EXPECT_EQ((*a)->radiance(4, view, light), (*b)->radiance(4, view, light));
    }
  }
}

TEST_F(FixedDirectionsTest, DirectionsBeyondTheDataAreRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Direction beyond = direction_from_angles({80 * kDegree, 0.3});
  for (const auto& fixed : {FixedDirections{},
                            FixedDirections{beyond, {}},
                            FixedDirections{{}, beyond},
                            FixedDirections{Direction(0, 0, -1), {}},
                            FixedDirections{Direction(nan, 0, 1), {}}}) {
    const auto refused = fix(fixed, "none.btfset");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "none.btfset"));
  }
  // On the border is within.
  EXPECT_TRUE(fix({direction_from_angles({1.0, 0.0}), {}}, "border.btfset"));
}

}  // namespace
}  // namespace veneer::btf
