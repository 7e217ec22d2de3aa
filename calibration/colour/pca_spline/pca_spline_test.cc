// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/pca_spline/pca_spline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/plvc/plvc.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

TEST(PcaSpline, OfThreeComponentsIsTheSplinePlvc) {
  constexpr double kRounding = 1e-11;  // of a change of basis and back, in parts of white
  const double white = LadderProjector({}).white().norm();
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const ExampleReadings readings = example_readings({0.06, 0, 0}, 0.02, seed);
    const auto pca = pca_spline(readings.patches, readings.black, 3);
    const auto plvc = fit_plvc_spline(readings.patches, readings.black);
    ASSERT_TRUE(pca.has_value() && plvc.has_value());
    Pcg32 random(seed);
    for (int i = 0; i < 50; ++i) {
      // Beyond the cube, too.
      const Vector3d drive = 1.4 * random_drive(random) - Vector3d::Constant(0.2);
      EXPECT_LT((pca->forward(drive) - (*plvc)->forward(drive)).norm(), kRounding * white)
          << "seed " << seed << " " << drive.transpose();
    }
  }
}

TEST(PcaSpline, OfMoreComponentsIsNearerToTheRamps) {
  const ExampleReadings readings = example_readings({0.06, 0, 0}, 0.01);
  double last = HUGE_VAL;
  for (int components = 1; components <= 3; ++components) {
    const auto model = pca_spline(readings.patches, readings.black, components);
    ASSERT_TRUE(model.has_value());
    double squares = 0.0;
    for (const PatchReading& patch : readings.patches) {
      if ((patch.drive.array() > 0.0).count() == 1)
        squares += (model->forward(patch.drive) + readings.black - patch.xyz).squaredNorm();
    }
    EXPECT_LT(squares, last) << components;
    last = squares;
  }
}

TEST(PcaSpline, OfOneComponentKeepsChromaticity) {
  const ExampleReadings readings = example_readings({0.06, 0, 0}, 0.01);
  const auto model = pca_spline(readings.patches, readings.black, 1);
  ASSERT_TRUE(model.has_value());
  for (Eigen::Index c = 0; c < 3; ++c) {
    const Xyz full = model->forward(Vector3d::Unit(c)).normalized();
    for (double d = 0.1; d < 1.0; d += 0.1)
      EXPECT_LT((model->forward(d * Vector3d::Unit(c)).normalized() - full).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace veneer::calibration
