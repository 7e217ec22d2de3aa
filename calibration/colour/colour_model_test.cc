// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/colour_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kNoise = 0.003;
const double kWhite = LadderProjector({}).white().norm();
constexpr double kRounding = 1e-12;  // in parts of white

std::unique_ptr<ColourModel> fit(const ColourModelFamily& family,
                                 const LadderDefects& defects,
                                 double noise = kNoise) {
  const ExampleReadings readings = example_readings(defects, noise);
  auto model = family.fit(readings.patches, readings.black);
  EXPECT_TRUE(model.has_value()) << family.name << ": " << model.error().what;
  return model ? std::move(*model) : nullptr;
}

TEST(ColourModels, KeepTheirNamesAndSayWhatTheyFitted) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    EXPECT_EQ(model->name(), family.name);
    EXPECT_EQ(model->is_additive(), !family.models_interaction) << family.name;
    EXPECT_GE(model->parameters(), 15) << family.name;
    EXPECT_FALSE(family.summary.empty());
  }
}

TEST(ColourModels, SendNothingAboveBlackAtDriveZero) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    EXPECT_LT(model->forward(Vector3d::Zero()).norm(), kRounding * kWhite) << family.name;
  }
}

TEST(ColourModels, AreAdditiveWhereTheySaySo) {
  Pcg32 random(1);
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    double most = 0.0;
    for (int i = 0; i < 50; ++i) {
      const Vector3d d = random_drive(random);
      const Xyz sum = model->forward({d[0], 0, 0}) + model->forward({0, d[1], 0}) +
                      model->forward({0, 0, d[2]});
      most = std::max(most, (sum - model->forward(d)).norm() / kWhite);
    }
    if (model->is_additive()) {
      EXPECT_LT(most, kRounding) << family.name;
    } else {
      EXPECT_GT(most, 1e-3) << family.name;
    }
  }
}

TEST(ColourModels, HaveTheJacobianOfTheirForward) {
  constexpr double kStep = 1e-6;
  // Rounding over the step, and the second derivative times it; relative to white.
  constexpr double kDifference = 1e-4;
  Pcg32 random(2);
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    int off = 0;
    for (int i = 0; i < 200; ++i) {
      const Vector3d d = random_drive(random) * 0.999;
      Matrix3d quotient;
      for (Eigen::Index c = 0; c < 3; ++c)
        quotient.col(c) =
            (model->forward(d + kStep * Vector3d::Unit(c)) - model->forward(d)) / kStep;
      if ((quotient - model->jacobian(d)).norm() > kDifference * kWhite) ++off;
    }
    // A step may fall across a crease of a piecewise model, once in a thousand.
    EXPECT_LE(off, 1) << family.name;
  }
}

TEST(ColourModels, GoStraightOnBeyondTheCube) {
  Pcg32 random(3);
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, kEveryDefect);
    ASSERT_NE(model, nullptr);
    for (int i = 0; i < 50; ++i) {
      Vector3d border = random_drive(random);
      Vector3d out = Vector3d::Zero();
      const Eigen::Index c = i % 3;
      border[c] = i % 2;
      out[c] = i % 2 == 0 ? -1.0 : 1.0;
      const Xyz at = model->forward(border);
      const Xyz slope = model->jacobian(border) * out;
      // Continuous, and a straight line whose slope is the border's. (On a crease there are two.)
      const Xyz near = model->forward(border + 0.1 * out);
      const Xyz far = model->forward(border + 0.2 * out);
      EXPECT_LT((far - 2.0 * near + at).norm(), 1e-9 * kWhite) << family.name << " " << i;
      EXPECT_LT((near - at - 0.1 * slope).norm(), 1e-9 * kWhite) << family.name << " " << i;
    }
  }
}

TEST(ColourModels, GiveNanForNan) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, {});
    ASSERT_NE(model, nullptr);
    for (Eigen::Index c = 0; c < 3; ++c) {
      Vector3d drive(0.3, 0.4, 0.5);
      drive[c] = std::nan("");
      EXPECT_TRUE(model->forward(drive).hasNaN()) << family.name;
      EXPECT_FALSE(model->direct_inverse(model->forward(drive)).has_value()) << family.name;
    }
  }
}

TEST(ColourModels, RiseAlongEveryRampHoweverDarkAndNoisy) {
  // Noise of whole dark levels, as of an instrument at its limit.
  Pcg32 random(4);
  for (const ColourModelFamily& family : colour_model_families()) {
    if (family.models_interaction) continue;
    ExampleReadings readings = example_readings({});
    for (PatchReading& reading : readings.patches)
      reading.xyz += 0.3 * Xyz(random.normal(), random.normal(), random.normal());
    const auto model = family.fit(readings.patches, readings.black);
    ASSERT_TRUE(model.has_value()) << family.name << ": " << model.error().what;
    // A smooth cubic through levels that rise may dip between them, by a part of their noise.
    const bool smooth = family.name == "plvc-spline" || family.name == "pca2-spline";
    const double most_fall = smooth ? 0.3 : 1e-9;
    for (Eigen::Index c = 0; c < 3; ++c) {
      double highest = 0.0;
      for (double d = 0.0; d <= 1.0; d += 1.0 / 1024) {
        const double light = (*model)->forward(d * Vector3d::Unit(c)).y();
        EXPECT_GE(light, highest - most_fall) << family.name << " " << c << " " << d;
        highest = std::max(highest, light);
      }
    }
  }
}

TEST(ColourModels, ThatInvertThemselvesReturn) {
  Pcg32 random(5);
  const std::set<std::string_view> direct{"gog", "lut3d", "pca1-spline", "plcc", "plcc-spline"};
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = fit(family, {});
    ASSERT_NE(model, nullptr);
    for (int i = 0; i < 300; ++i) {
      // The corners, too.
      const Vector3d d = i < 8 ? Vector3d(i & 1, i >> 1 & 1, i >> 2 & 1) : random_drive(random);
      const Xyz xyz = model->forward(d);
      const auto drive = model->direct_inverse(xyz);
      ASSERT_EQ(drive.has_value(), direct.contains(family.name))
          << family.name << " " << d.transpose();
      if (!drive) continue;
      EXPECT_TRUE(drive->minCoeff() >= 0.0 && drive->maxCoeff() <= 1.0);
      EXPECT_LT((model->forward(*drive) - xyz).norm(), 1e-8 * kWhite) << family.name;
    }
    EXPECT_FALSE(model->direct_inverse(1.01 * model->forward(Vector3d::Ones())).has_value());
    EXPECT_FALSE(model->direct_inverse({-1, -1, -1}).has_value());
  }
}

TEST(ColourModels, ReproduceTheRampsThatTheyWereFittedOn) {
  const ExampleReadings readings = example_readings({0.06, 0, 0});
  for (const std::string_view name : {"plvc", "plvc-spline", "pca2-spline"}) {
    for (const ColourModelFamily& family : colour_model_families()) {
      if (family.name != name) continue;
      const auto model = fit(family, {0.06, 0, 0}, 0.0);
      for (const PatchReading& patch : readings.patches) {
        // Drift along one line is of rank two: exact without noise.
        EXPECT_LT((model->forward(patch.drive) + readings.black - patch.xyz).norm(), 1e-9 * kWhite)
            << name << " " << patch.drive.transpose();
      }
    }
  }
}

TEST(ColourModels, RefuseTooFewPatchesAndSayWhichAreMissing) {
  const ExampleReadings readings = example_readings({});
  const std::vector<PatchReading> ramps(readings.patches.begin(), readings.patches.begin() + 52);
  for (const ColourModelFamily& family : colour_model_families()) {
    const auto model = family.fit(ramps, readings.black);
    ASSERT_EQ(model.has_value(), !family.models_interaction) << family.name;
    if (!model) {
      EXPECT_THAT(model.error().what, HasSubstr("measure")) << family.name;
    }
    EXPECT_FALSE(family.fit({}, readings.black).has_value()) << family.name;
  }
}

}  // namespace
}  // namespace veneer::calibration
