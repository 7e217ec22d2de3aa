// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/interaction/interaction.h"

#include <gtest/gtest.h>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/pca_spline/pca_spline.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

TEST(Interaction, FindsInteractionThatIsInItsTerms) {
  const ExampleReadings additive = example_readings({});
  const auto core = pca_spline(additive.patches, additive.black, 2);
  ASSERT_TRUE(core.has_value());
  const auto light = [&](const Vector3d& d) -> Xyz {
    const Vector3d t = core->linear_drive(d);
    return core->forward(d) + Xyz(-9, -7, 3) * t[0] * t[1] +
           Xyz(2, 5, 8) * t[2] * (1.1 * t[0] / (t[0] + 0.1)) + Xyz(4, -6, 1) * t.prod();
  };
  std::vector<PatchReading> patches = additive.patches;
  for (PatchReading& patch : patches) patch.xyz = light(patch.drive) + additive.black;
  const auto model = fit_interaction(patches, additive.black);
  ASSERT_TRUE(model.has_value()) << model.error().what;
  Pcg32 random(1);
  for (int i = 0; i < 100; ++i) {
    const Vector3d drive = random_drive(random);
    EXPECT_LT(((*model)->forward(drive) - light(drive)).norm(),
              1e-8 * light(Vector3d::Ones()).norm())
        << drive.transpose();
  }
}

TEST(Interaction, LeavesSingleChannelsAlone) {
  const ExampleReadings readings = example_readings(kEveryDefect, 0.003);
  const auto model = fit_interaction(readings.patches, readings.black);
  const auto core = pca_spline(readings.patches, readings.black, 2);
  ASSERT_TRUE(model.has_value() && core.has_value());
  for (Eigen::Index c = 0; c < 3; ++c) {
    for (double d = 0.0; d <= 1.0; d += 0.05) {
      const Vector3d drive = d * Vector3d::Unit(c);
      EXPECT_LT(((*model)->forward(drive) - core->forward(drive)).norm(), 1e-10) << c << " " << d;
    }
  }
}

TEST(Interaction, RefusesMixturesThatDoNotTellItsTermsApart) {
  ExampleReadings readings = example_readings({});
  // Greys alone are one line through the cube.
  ColourPatchOptions greys;
  greys.ramp_levels = 40;
  greys.grey_levels = 40;
  greys.cube = 0;
  std::vector<Rgb16> patches = ramp_patches(greys);
  const std::vector<Rgb16> more = interaction_patches(greys);
  patches.insert(patches.end(), more.begin(), more.end());
  readings.patches = LadderProjector({}).read(patches, 8, 0.0, 1);
  const auto model = fit_interaction(readings.patches, readings.black);
  ASSERT_FALSE(model.has_value());
  EXPECT_NE(model.error().what.find("terms apart"), std::string::npos) << model.error().what;
}

}  // namespace
}  // namespace veneer::calibration
