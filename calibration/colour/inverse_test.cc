// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/inverse.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/ipt.h"
#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

constexpr double kNoise = 0.003;

struct Fitted {
  std::unique_ptr<ColourModel> model;
  Xyz black;
};

Fitted fit(const ColourModelFamily& family, const LadderDefects& defects) {
  const ExampleReadings readings = example_readings(defects, kNoise);
  auto model = family.fit(readings.patches, readings.black);
  EXPECT_TRUE(model.has_value()) << family.name << ": " << model.error().what;
  return {model ? std::move(*model) : nullptr, readings.black};
}

bool in_cube(const Vector3d& drive) { return drive.minCoeff() >= 0.0 && drive.maxCoeff() <= 1.0; }

TEST(ColourInverse, ReturnsWhatTheModelCanShow) {
  for (const LadderDefects& defects :
       {LadderDefects{}, LadderDefects{0.06, 0, 0.05}, LadderDefects{0, 0.25, 0}, kEveryDefect}) {
    for (const ColourModelFamily& family : colour_model_families()) {
      const Fitted fitted = fit(family, defects);
      ASSERT_NE(fitted.model, nullptr);
      const auto inverse = ColourInverse::make(*fitted.model, fitted.black);
      ASSERT_TRUE(inverse.has_value()) << inverse.error().what;
      Pcg32 random(1);
      for (int i = 0; i < 200; ++i) {
        const Vector3d drive =
            i < 8 ? Vector3d(i & 1, i >> 1 & 1, i >> 2 & 1) : random_drive(random);
        const InverseColour result = (*inverse)(fitted.model->forward(drive));
        EXPECT_TRUE(in_cube(result.drive)) << family.name << " " << drive.transpose();
        EXPECT_TRUE(result.in_gamut) << family.name << " " << drive.transpose();
        EXPECT_EQ(result.gamut_loss, 0.0);
        // A millionth of white, unless the drive of two colours is the same (a curve's flat start).
        EXPECT_LT(result.residual, ColourInverse::kReached)
            << family.name << " " << drive.transpose();
      }
    }
  }
}

TEST(ColourInverse, FindsTheDriveItselfWhereCurvesAreSteep) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const Fitted fitted = fit(family, kEveryDefect);
    ASSERT_NE(fitted.model, nullptr);
    const auto inverse = ColourInverse::make(*fitted.model, fitted.black);
    ASSERT_TRUE(inverse.has_value());
    Pcg32 random(2);
    for (int i = 0; i < 100; ++i) {
      const Vector3d drive = Vector3d::Constant(0.3) + 0.6 * random_drive(random);
      const InverseColour result = (*inverse)(fitted.model->forward(drive));
      // A tenth of a code of 8 bits; 1e-5 of white over the least slope of a tone curve there,
      // which is about a half, is less.
      EXPECT_LT((result.drive - drive).cwiseAbs().maxCoeff(), 4e-4)
          << family.name << " " << drive.transpose();
    }
  }
}

TEST(ColourInverse, StaysInTheCubeAndEndsWhateverIsAsked) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const ColourModelFamily& family : colour_model_families()) {
    const Fitted fitted = fit(family, kEveryDefect);
    ASSERT_NE(fitted.model, nullptr);
    const auto inverse = ColourInverse::make(*fitted.model, fitted.black);
    ASSERT_TRUE(inverse.has_value());
    Pcg32 random(3);
    for (int i = 0; i < 60; ++i) {
      const Xyz target(700 * random.normal(), 700 * random.normal(), 700 * random.normal());
      const InverseColour result = (*inverse)(target);
      EXPECT_TRUE(in_cube(result.drive)) << family.name << " " << target.transpose();
      EXPECT_TRUE(std::isfinite(result.residual) && std::isfinite(result.gamut_loss));
      EXPECT_FALSE(result.in_gamut);
      EXPECT_GT(result.gamut_loss, 0.0);
    }
    for (const Xyz& target : {Xyz(std::nan(""), 1, 1), Xyz(1, infinity, 1), Xyz(1, 1, -infinity)}) {
      const InverseColour result = (*inverse)(target);
      EXPECT_EQ(result.drive, Vector3d::Zero());
      EXPECT_EQ(result.residual, infinity);
      EXPECT_FALSE(result.in_gamut);
    }
    for (const Xyz& target : {Xyz(1e300, 1e300, 1e300), Xyz(-1e300, 0, 1e300), Xyz(1e-300, 0, 0)})
      EXPECT_TRUE(in_cube((*inverse)(target).drive)) << family.name;
  }
}

TEST(ColourInverse, KeepsHueOfWhatIsOutOfGamut) {
  for (const ColourModelFamily& family : colour_model_families()) {
    const Fitted fitted = fit(family, {0.06, 0, 0.05});
    ASSERT_NE(fitted.model, nullptr);
    const auto inverse = ColourInverse::make(*fitted.model, fitted.black);
    ASSERT_TRUE(inverse.has_value());
    const Xyz white = fitted.model->forward(Vector3d::Ones()) + fitted.black;
    const auto ipt_of = [&](const Xyz& xyz) {
      return ipt_from_cones((cones_from_xyz() * xyz).cwiseQuotient(cones_from_xyz() * white));
    };
    Pcg32 random(4);
    int out = 0;
    for (int i = 0; i < 100; ++i) {
      // More saturated than a drive can be, or brighter.
      const Vector3d drive = random_drive(random);
      const Xyz grey = fitted.model->forward(Vector3d::Constant(drive.mean()));
      const Xyz target = grey + 1.3 * (fitted.model->forward(drive) - grey);
      const InverseColour result = (*inverse)(target);
      if (result.in_gamut) continue;
      ++out;
      EXPECT_LT(result.residual, 10 * ColourInverse::kReached) << family.name;
      const Ipt wanted = ipt_of(target + fitted.black);
      const Ipt got = ipt_of(fitted.model->forward(result.drive) + fitted.black);
      // The loss is the way from one to the other. A thousandth in IPT is a tenth of a just
      // noticeable difference: what kReached is in the dark.
      EXPECT_NEAR(100 * (wanted - got).norm(), result.gamut_loss, 0.2)
          << family.name << " " << target.transpose();
      const double cross = wanted[1] * got[2] - wanted[2] * got[1];
      const double chroma = std::hypot(wanted[1], wanted[2]);
      EXPECT_LT(std::abs(cross) / chroma, 2e-3) << family.name << " " << target.transpose();
      EXPECT_GE(wanted[1] * got[1] + wanted[2] * got[2], -1e-3) << family.name;
    }
    EXPECT_GT(out, 20) << family.name;
  }
}

// Two colours of drive that a matrix alone cannot tell: folds back over itself.
class FoldedModel final : public ColourModel {
 public:
  [[nodiscard]] std::string_view name() const override { return "folded"; }
  [[nodiscard]] Xyz forward(const Vector3d& d) const override {
    return 100.0 * Xyz(d[0] + 2.0 * d[0] * d[1] * (d[1] - 0.9),
                       d[1] + std::sin(6 * d[0] * d[2]) * 0.5 * d[2],
                       d[2]);
  }
  [[nodiscard]] Eigen::Matrix3d jacobian(const Vector3d&) const override {
    return Eigen::Matrix3d::Identity();  // wrong: the inverse must not rely on it
  }
  [[nodiscard]] bool is_additive() const override { return false; }
  [[nodiscard]] int parameters() const override { return 0; }
};

TEST(ColourInverse, NeverDoesWorseThanItsStartOnAFoldedModel) {
  const FoldedModel model;
  const auto inverse = ColourInverse::make(model, Xyz::Zero());
  ASSERT_TRUE(inverse.has_value()) << inverse.error().what;
  Pcg32 random(5);
  int reached = 0;
  for (int i = 0; i < 300; ++i) {
    const Xyz target = model.forward(random_drive(random));
    const InverseColour result = (*inverse)(target);
    EXPECT_TRUE(in_cube(result.drive));
    EXPECT_TRUE(std::isfinite(result.residual));
    // Two starts and the walk in gamut mapping, each bounded.
    EXPECT_LE(result.iterations, 2 * ColourInverse::kMostIterations * 14);
    if (result.in_gamut) ++reached;
  }
  EXPECT_GT(reached, 240);
}

TEST(ColourInverse, RefusesAModelWithoutWhite) {
  const Fitted fitted = fit(colour_model_families().front(), {});
  EXPECT_FALSE(ColourInverse::make(*fitted.model, Xyz::Constant(std::nan(""))).has_value());
}

}  // namespace
}  // namespace veneer::calibration
