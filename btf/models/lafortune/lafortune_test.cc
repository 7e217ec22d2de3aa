// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lafortune/lafortune.h"

#include <gtest/gtest.h>

#include <cmath>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

using testing::make_set;
using testing::random_direction;

SampleSetInfo info_of_one_texel() {
  SampleSetInfo info;
  info.width = info.height = 1;
  info.views = info.lights = bonn_directions();
  info.source = "a formula";
  return info;
}

Result<std::unique_ptr<Material>> fit_shiny(const std::filesystem::path& folder, int lobes) {
  const SampleSetInfo info = info_of_one_texel();
  const SampleSet set = make_set(folder, info, [&](int, int view, int light, int channel) {
    const Direction& v = info.views[static_cast<std::size_t>(view)];
    const Direction& l = info.lights[static_cast<std::size_t>(light)];
    const double shine = std::pow(std::max(0.0, v.z() * l.z() - v.x() * l.x() - v.y() * l.y()), 9);
    return static_cast<float>(l.z() * (0.1 + 0.2 * channel + 0.6 * shine));
  });
  FitOptions options;
  options.lobes = lobes;
  SilentProgress progress;
  return fit_lafortune(set, options, progress);
}

TEST(Lafortune, IsReciprocalButForTheCosine) {
  const TemporaryFolder folder;
  const auto material = fit_shiny(folder.path() / "a.btfset", 2);
  ASSERT_TRUE(material) << material.error().what;
  Pcg32 random(1);
  for (int i = 0; i < 1000; ++i) {
    const Direction a = random_direction(random, 1e-3);
    const Direction b = random_direction(random, 1e-3);
    EXPECT_TRUE(((*material)->radiance(0, a, b) / b.z())
                    .isApprox((*material)->radiance(0, b, a) / a.z(), 1e-9));
  }
}

TEST(Lafortune, IsExactForItsOwnFormula) {
  // The samples' own lobe is on float16: what is left is the samples' rounding, 2^-12 of up to 1.1.
  constexpr double kRounding = 2e-3;
  const TemporaryFolder folder;
  const auto material = fit_shiny(folder.path() / "a.btfset", 1);
  ASSERT_TRUE(material) << material.error().what;
  for (const double theta : {0.0, 0.4, 0.8}) {
    const Direction light = direction_from_angles({theta, 0.3});
    const Direction mirrored(-light.x(), -light.y(), light.z());
    EXPECT_NEAR((*material)->radiance(0, mirrored, light)[0], 0.7 * light.z(), kRounding);
  }
}

TEST(Lafortune, AViewBelowTheHorizonCountsAsOnIt) {
  const TemporaryFolder folder;
  const auto material = fit_shiny(folder.path() / "a.btfset", 1);
  ASSERT_TRUE(material) << material.error().what;
  const Direction light = direction_from_angles({1.2, 0.0});
  EXPECT_EQ((*material)->radiance(0, {-0.99, 0.0, -0.1}, light),
            (*material)->radiance(0, {-0.99, 0.0, 0.0}, light));
}

TEST(Lafortune, RefusesLobesOutOfRangeAndForms) {
  const TemporaryFolder folder;
  for (const int lobes : {0, 5}) {
    const auto material = fit_shiny(folder.path() / std::to_string(lobes), lobes);
    ASSERT_FALSE(material);
    EXPECT_EQ(material.error().code, Errc::kInvalidOption) << material.error().what;
  }
}

}  // namespace
}  // namespace veneer::btf
