// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/white_segment/white_segment.h"

#include <gtest/gtest.h>

#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

TEST(WhiteSegment, ReproducesItsGreysAndWhatHasTheSameLeastDrive) {
  const LadderDefects defects{0, 0.25, 0};
  const LadderProjector projector(defects);
  const ExampleReadings readings = example_readings(defects);
  const auto model = fit_white_segment(readings.patches, readings.black);
  ASSERT_TRUE(model.has_value()) << model.error().what;
  // The segment follows the least linear drive in proportion, which a cubic keeps; what is left is
  // the ramps' curve between their levels.
  const double tolerance = 2e-3 * projector.white().norm();
  Pcg32 random(1);
  for (int i = 0; i < 500; ++i) {
    const Vector3d drive = random_drive(random);
    EXPECT_LT(((*model)->forward(drive) + readings.black - projector.light(drive)).norm(),
              tolerance)
        << drive.transpose();
  }
  for (const PatchReading& patch : readings.patches)
    EXPECT_LT(((*model)->forward(patch.drive) + readings.black - patch.xyz).norm(),
              1e-3 * tolerance)
        << patch.drive.transpose();
}

TEST(WhiteSegment, IsNoneWhereChannelsAddUp) {
  const ExampleReadings readings = example_readings({});
  const auto model = fit_white_segment(readings.patches, readings.black);
  ASSERT_TRUE(model.has_value());
  const Xyz white = (*model)->forward(Vector3d::Ones());
  const Xyz sum = (*model)->forward(Vector3d::UnitX()) + (*model)->forward(Vector3d::UnitY()) +
                  (*model)->forward(Vector3d::UnitZ());
  EXPECT_LT((white - sum).norm(), 1e-9 * white.norm());
}

TEST(WhiteSegment, NeverTakesLightAway) {
  // Channels that lose light to each other are not what it is for: it stays additive.
  const ExampleReadings readings = example_readings({0, 0, 0.05});
  const auto model = fit_white_segment(readings.patches, readings.black);
  ASSERT_TRUE(model.has_value());
  const Xyz white = (*model)->forward(Vector3d::Ones());
  const Xyz sum = (*model)->forward(Vector3d::UnitX()) + (*model)->forward(Vector3d::UnitY()) +
                  (*model)->forward(Vector3d::UnitZ());
  EXPECT_TRUE(((white - sum).array() >= -1e-9).all());
}

TEST(WhiteSegment, WantsTheGreyAxisWithWhite) {
  ExampleReadings readings = example_readings({0, 0.25, 0});
  std::erase_if(readings.patches,
                [](const PatchReading& patch) { return patch.drive == Vector3d::Ones(); });
  const auto model = fit_white_segment(readings.patches, readings.black);
  ASSERT_FALSE(model.has_value());
  EXPECT_NE(model.error().what.find("without white"), std::string::npos) << model.error().what;
}

}  // namespace
}  // namespace veneer::calibration
