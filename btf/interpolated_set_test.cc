// SPDX-License-Identifier: Apache-2.0
#include "btf/interpolated_set.h"

#include <gtest/gtest.h>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

SampleSetInfo bonn_info(bool polarised) {
  SampleSetInfo info;
  info.width = 2;
  info.height = 1;
  info.polarised = polarised;
  info.views = bonn_directions();
  info.lights = bonn_directions();
  return info;
}

float pattern(int texel, int view, int light, int channel) {
  return 0.125F * static_cast<float>((7 * texel + 3 * view + 5 * light + channel) % 11);
}

TEST(InterpolatedSet, ReturnsTheSamplesAtTheirDirections) {
  for (const bool polarised : {false, true}) {
    const TemporaryFolder folder;
    const InterpolatedSet set(
        testing::make_set(folder.path() / "a.btfset", bonn_info(polarised), pattern));
    const SampleSetInfo& info = set.set().info();
    std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
    set.set().rgb(1, Part::kTotal, rgb);
    for (std::size_t pair = 0; pair < rgb.size() / 3; pair += 13) {
      const Eigen::Vector3d got = set.radiance(
          1, info.views[pair / info.lights.size()], info.lights[pair % info.lights.size()]);
      // Weights at a node are off 0 and 1 by their own rounding.
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(got[static_cast<Eigen::Index>(c)], rgb[pair * 3 + c], 1e-11);
    }
  }
}

// A matt sheet: samples cos(theta_l) over the norm of the weighted mean; between the rings of 15
// degrees linear interpolation cuts the corner by at most 1 - cos(10 degrees).
TEST(InterpolatedSet, MattSheetFollowsTheCosineOfTheLight) {
  const TemporaryFolder folder;
  const SampleSetInfo info = bonn_info(false);
  const InterpolatedSet set(
      testing::make_set(folder.path() / "a.btfset", info, [&](int, int, int light, int) {
        return static_cast<float>(info.lights[static_cast<std::size_t>(light)].z());
      }));
  Pcg32 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Direction view = testing::random_direction(random);
    const Direction light = testing::random_direction(random, -0.5);
    const Eigen::Vector3d got = set.radiance(0, view, light);
    EXPECT_NEAR(got[0], std::max(light.z(), 0.0), 0.016);
    EXPECT_EQ(got[0], got[2]);
    if (light.z() <= 0.0) {
      EXPECT_EQ(got[1], 0.0);
    }
  }
}

}  // namespace
}  // namespace veneer::btf
