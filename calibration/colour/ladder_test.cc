// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/ladder.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

TEST(LadderProjector, HasTheDefectsThatItIsGiven) {
  const LadderProjector plain({});
  EXPECT_NEAR(plain.white().y(), 290.0 * 1.0026, 1e-9);
  EXPECT_NEAR(plain.black().y() / (plain.white().y() - plain.black().y()), 0.0026, 1e-12);
  const auto sum_of_channels = [](const LadderProjector& projector) -> Xyz {
    Xyz sum = Xyz::Zero();
    for (Eigen::Index c = 0; c < 3; ++c)
      sum += projector.light(Vector3d::Unit(c)) - projector.black();
    return sum;
  };
  const Xyz sum = sum_of_channels(plain);
  EXPECT_LT((plain.white() - plain.black() - sum).norm(), 1e-9);
  const LadderProjector segment({0, 0.25, 0});
  EXPECT_LT((segment.white() - segment.black() - 1.25 * sum).norm(), 1e-9);
  const LadderProjector crosstalk({0, 0, 0.05});
  EXPECT_LT((crosstalk.white() - crosstalk.black() - 0.95 * sum).norm(), 1e-9);
  // Drift leaves full drive and luminance alone.
  const LadderProjector drift({0.06, 0, 0});
  EXPECT_LT((sum_of_channels(drift) - sum).norm(), 1e-9);
  const Vector3d half(0.5, 0, 0);
  EXPECT_NEAR(drift.light(half).y(), plain.light(half).y(), 1e-9);
  EXPECT_GT((drift.light(half) - plain.light(half)).norm(), 0.01 * plain.light(half).norm());
}

TEST(LadderProjector, ReadsWithTheNoiseAskedForAndRepeats) {
  const LadderProjector projector({});
  const std::vector<Rgb16> patches(2000, Rgb16{200, 100, 50});
  const auto readings = projector.read(patches, 8, 0.003, 7);
  const Xyz light = projector.light(drive_of_code(patches[0], 8));
  Vector3d squares = Vector3d::Zero();
  for (const PatchReading& reading : readings)
    squares += ((reading.xyz - light).cwiseQuotient(light)).cwiseAbs2();
  for (Eigen::Index c = 0; c < 3; ++c)
    EXPECT_NEAR(std::sqrt(squares[c] / 2000), 0.003, 0.0003) << c;  // six standard deviations
  EXPECT_EQ(projector.read(patches, 8, 0.003, 7)[1999].xyz, readings[1999].xyz);
  EXPECT_NE(projector.read(patches, 8, 0.003, 8)[1999].xyz, readings[1999].xyz);
  EXPECT_EQ(mean_black({}), Xyz::Zero());
}

TEST(Ladder, KeepsItsGates) {
  for (const LadderRung& rung : ladder_rungs()) {
    const auto result = climb(rung);
    ASSERT_TRUE(result.has_value()) << rung.defect << ": " << result.error().what;
    const bool additive = rung.defects.white_segment == 0.0 && rung.defects.crosstalk == 0.0;
    EXPECT_EQ(result->additive_verdicts, additive ? kLadderDraws : 0) << rung.defect;
    if (result->ramp_patches < 52) continue;
    EXPECT_EQ(result->ramp_patches, 52);
    const double allowed = additive ? 1.0 : 2.0;
    EXPECT_LE(result->chosen_error.mean, 0.5 * allowed) << rung.defect;
    EXPECT_LE(result->chosen_error.p95, 1.0 * allowed) << rung.defect;
    EXPECT_LE(result->chosen_error.max, 2.0 * allowed) << rung.defect;
  }
}

TEST(Ladder, OrdersTheModelsAsTheDefectsDemand) {
  const auto mean_of = [](const LadderResult& result, std::string_view name) {
    for (const ColourCandidate& model : result.models) {
      if (model.name == name) return model.held_out.mean;
    }
    ADD_FAILURE() << name;
    return 0.0;
  };
  const auto drift = climb({"drift", {0.06, 0, 0}, 16});
  ASSERT_TRUE(drift.has_value());
  // A channel that drifts along a line is of rank two.
  EXPECT_LT(mean_of(*drift, "pca2-spline"), 0.5 * mean_of(*drift, "pca1-spline"));
  EXPECT_LT(mean_of(*drift, "plvc"), 0.5 * mean_of(*drift, "plcc"));
  const auto segment = climb({"segment", {0, 0.25, 0}, 16});
  ASSERT_TRUE(segment.has_value());
  EXPECT_LT(mean_of(*segment, "white-segment"), 0.25 * mean_of(*segment, "pca2-spline"));
  const auto crosstalk = climb({"crosstalk", {0, 0, 0.05}, 16});
  ASSERT_TRUE(crosstalk.has_value());
  EXPECT_LT(mean_of(*crosstalk, "interaction"), 0.6 * mean_of(*crosstalk, "pca2-spline"));
}

}  // namespace
}  // namespace veneer::calibration
