// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/gog/gog.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "calibration/colour/gog/gain_offset_gamma.h"
#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

TEST(GainOffsetGamma, RunsFromZeroToOneAndNeverFalls) {
  for (const double offset : {-0.3, -0.1, 0.0, 0.05, 0.3}) {
    for (const double exponent : {1.0, 1.8, 2.2, 5.0}) {
      const GainOffsetGamma curve(offset, exponent);
      EXPECT_NEAR(curve(0.0), 0.0, 1e-15);
      EXPECT_NEAR(curve(1.0), 1.0, 1e-15);
      double last = 0.0;
      for (double d = 0.0; d <= 1.0; d += 1e-3) {
        EXPECT_GE(curve(d), last - 1e-15) << offset << " " << exponent << " " << d;
        last = curve(d);
      }
      EXPECT_NEAR(curve(1.5), 1.0 + 0.5 * curve.slope_at(1.0), 1e-12);
      EXPECT_NEAR(curve(-0.5), -0.5 * curve.slope_at(0.0), 1e-12);
      EXPECT_TRUE(std::isnan(curve(std::nan(""))));
    }
  }
}

TEST(Gog, FindsAProjectorOfItsOwnKind) {
  const std::array curves{
      GainOffsetGamma(0.05, 2.2), GainOffsetGamma(-0.02, 1.9), GainOffsetGamma(0.0, 2.6)};
  const Xyz black(0.5, 0.5, 0.7);
  const Vector3d luminances(60, 200, 20);
  Eigen::Matrix3d primaries;
  primaries << 1.9, 0.48, 2.5, 1.0, 1.0, 1.0, 0.05, 0.1, 13.0;
  primaries = primaries * luminances.asDiagonal();
  const auto light = [&](const Vector3d& d) -> Xyz {
    return primaries * Vector3d(curves[0](d[0]), curves[1](d[1]), curves[2](d[2])) + black;
  };
  std::vector<PatchReading> patches;
  for (const Rgb16& code : example_patches()) {
    const Vector3d drive = drive_of_code(code, 8);
    patches.push_back({drive, light(drive)});
  }
  const auto model = fit_gog(patches, black);
  ASSERT_TRUE(model.has_value()) << model.error().what;
  Pcg32 random(1);
  for (int i = 0; i < 100; ++i) {
    const Vector3d drive = random_drive(random);
    // The last grid's step is about 1e-6 of the exponent's range.
    EXPECT_LT(((*model)->forward(drive) + black - light(drive)).norm(),
              1e-4 * light(Vector3d::Ones()).norm())
        << drive.transpose();
  }
}

}  // namespace
}  // namespace veneer::calibration
