// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/jones.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "simulation/studio/testing.h"

namespace veneer::simulation::studio {
namespace {

using simulation::testing::kDegree;
using simulation::testing::kPerfect;
using simulation::testing::on_arc;
using simulation::testing::toward;

constexpr double kRounding = 1e-12;
const Eigen::Vector3d kX = Eigen::Vector3d::UnitX();
const Eigen::Vector3d kY = Eigen::Vector3d::UnitY();
const Eigen::Vector3d kZ = Eigen::Vector3d::UnitZ();

Eigen::Vector3d random_direction(Pcg32& random) {
  return toward(85 * random.uniform(), 360 * random.uniform());
}

TEST(Jones, AcrossRayIsTheNearestPerpendicularVector) {
  Pcg32 random(1);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d axis = random_direction(random);
    const Eigen::Vector3d ray = random_direction(random);
    const Eigen::Vector3d across = across_ray(axis, ray);
    EXPECT_NEAR(across.norm(), 1, kRounding);
    EXPECT_NEAR(across.dot(ray), 0, 1e-9) << axis.transpose() << " / " << ray.transpose();
    for (int turn = 1; turn < 12; ++turn) {
      const Eigen::Vector3d other = Eigen::AngleAxisd(turn * 30 * kDegree, ray) * across;
      EXPECT_GE(axis.dot(across), axis.dot(other) - kRounding);
    }
  }
  EXPECT_TRUE(across_ray(kY, kY).hasNaN());
}

TEST(Jones, APolarisersLightHasUnitPowerAndItsContrast) {
  for (const double extinction : {1.0, 2.0, 100.0, 1e9, kPerfect}) {
    const Beam beam = polarised_beam(on_arc(30), kY, extinction);
    EXPECT_NEAR(power(beam), 1, kRounding) << extinction;
    const double along = Analyser(on_arc(30), kY, 0, kPerfect).passed(beam);
    const double across = Analyser(on_arc(30), kY, 90 * kDegree, kPerfect).passed(beam);
    EXPECT_NEAR(across, along / extinction, kRounding) << extinction;
    for (const Eigen::Vector3d& field : beam) EXPECT_NEAR(field.dot(on_arc(30)), 0, kRounding);
  }
}

TEST(Jones, AMirrorsContrastIsThatOfThePolarisersTimesMalus) {
  for (const double light_extinction : {3.0, 100.0, kPerfect})
    for (const double extinction : {2.0, 100.0, kPerfect})
      for (const double misalignment : {0.0, 3.0, -20.0, 45.0}) {
        const Eigen::Vector3d light = on_arc(10);
        const Beam beam =
            reflected_by_mirror(polarised_beam(light, kY, light_extinction), light, kZ);
        const double a = misalignment * kDegree;
        const double parallel = Analyser(kZ, kY, a, extinction).passed(beam);
        const double cross = Analyser(kZ, kY, a + 90 * kDegree, extinction).passed(beam);
        const double of_light = (1 - 1 / light_extinction) / (1 + 1 / light_extinction);
        const double of_analyser = (1 - 1 / extinction) / (1 + 1 / extinction);
        EXPECT_NEAR((parallel - cross) / (parallel + cross),
                    of_light * of_analyser * std::cos(2 * a),
                    kRounding)
            << light_extinction << ", " << extinction << ", " << misalignment;
      }
}

TEST(Jones, CrossedAnalysersShareAllLightButForTheirLeak) {
  Pcg32 random(2);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d light = random_direction(random);
    const Eigen::Vector3d view = random_direction(random);
    const double extinction = 1 + 200 * random.uniform();
    const double angle = 7 * random.uniform();
    const Beam beam = reflected_by_dielectric(polarised_beam(light, kY, 30), light, view, 1.5);
    const double both = Analyser(view, kY, angle, extinction).passed(beam) +
                        Analyser(view, kY, angle + 90 * kDegree, extinction).passed(beam);
    EXPECT_NEAR(both, (1 + 1 / extinction) * power(beam), 1e-9)
        << light.transpose() << " / " << view.transpose();
  }
}

TEST(Jones, UnpolarisedLightPassesAtAnyAngleAlike) {
  for (const double extinction : {1.0, 7.0, kPerfect})
    for (const double angle : {0.0, 0.3, 1.2, 2.9}) {
      const Analyser analyser(on_arc(20), kY, angle, extinction);
      EXPECT_NEAR(analyser.passed(polarised_beam(on_arc(20), kY, 1)),
                  0.5 * (1 + 1 / extinction),
                  kRounding);
      EXPECT_NEAR(analyser.passed_unpolarised(), 0.5 * (1 + 1 / extinction), kRounding);
    }
}

TEST(Jones, AnglesTurnCounterClockwiseForWhoLooksAtTheSample) {
  // From above, x is to the right and y up.
  const Beam between{(kX + kY).normalized(), Eigen::Vector3d::Zero()};
  EXPECT_NEAR(Analyser(kZ, kX, 45 * kDegree, kPerfect).passed(between), 1, kRounding);
  EXPECT_NEAR(Analyser(kZ, kX, -45 * kDegree, kPerfect).passed(between), 0, kRounding);
  EXPECT_NEAR(Analyser(kZ, kY, -45 * kDegree, kPerfect).passed(between), 1, kRounding);
}

TEST(Jones, ADielectricKeepsThePowerOfUnpolarisedLightAndCrossesNoRay) {
  Pcg32 random(3);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d light = random_direction(random);
    const Eigen::Vector3d view = random_direction(random);
    const Beam out = reflected_by_dielectric(polarised_beam(light, kY, 1), light, view, 1.5);
    EXPECT_NEAR(power(out), 1, 1e-9) << light.transpose() << " / " << view.transpose();
    for (const Eigen::Vector3d& field : out) EXPECT_NEAR(field.dot(view), 0, 1e-9);
  }
}

TEST(Jones, AtNormalIncidencePolarisationIsKept) {
  for (const double angle : {0.0, 20.0, 45.0, 120.0}) {
    const Eigen::Vector3d axis(std::cos(angle * kDegree), std::sin(angle * kDegree), 0);
    const Beam sent = polarised_beam(kZ, axis, kPerfect);
    const Analyser parallel(kZ, axis, 0, kPerfect);
    EXPECT_NEAR(parallel.passed(reflected_by_dielectric(sent, kZ, kZ, 1.5)), 1, kRounding);
    EXPECT_NEAR(parallel.passed(reflected_by_mirror(sent, kZ, kZ)), 1, kRounding);
  }
}

TEST(Jones, ThePlaneOfIncidenceVanishesWithoutAJump) {
  const Eigen::Vector3d light = toward(40, 30);
  const Beam sent = polarised_beam(light, kY, 10);
  const Analyser analyser(light, kY, 0.3, 50);
  const double there = analyser.passed(reflected_by_dielectric(sent, light, light, 1.5));
  for (const double off : {1e-12, 1e-10, 1e-8, 1e-6}) {
    const Eigen::Vector3d view = (light + off * kX).normalized();
    EXPECT_NEAR(analyser.passed(reflected_by_dielectric(sent, light, view, 1.5)), there, 1e-5)
        << off;
  }
}

TEST(Jones, ADielectricOfHighestIndexIsAMirror) {
  Pcg32 random(4);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d light = random_direction(random);
    const Eigen::Vector3d view = random_direction(random);
    const Beam sent = polarised_beam(light, kX, 5);
    const Beam metal = reflected_by_mirror(sent, light, view);
    const Beam dielectric = reflected_by_dielectric(sent, light, view, 1e7);
    for (std::size_t field = 0; field < 2; ++field)
      EXPECT_NEAR((metal[field] - dielectric[field]).norm(), 0, 1e-5)
          << light.transpose() << " / " << view.transpose();
  }
}

TEST(Jones, AtBrewstersAngleOnlySIsReflected) {
  const double brewster = std::atan(1.5) / kDegree;
  const Eigen::Vector3d light = on_arc(brewster);
  const Eigen::Vector3d view = on_arc(-brewster);
  EXPECT_NEAR(power(reflected_by_dielectric(polarised_beam(light, kX, kPerfect), light, view, 1.5)),
              0,
              kRounding);
  EXPECT_NEAR(power(reflected_by_dielectric(polarised_beam(light, kY, kPerfect), light, view, 1.5)),
              2,
              kRounding);
}

// The figures of the issue, to its digits; and Fresnel's formulas in their other form, in which the
// index is hidden in the angle of refraction (Born and Wolf 1999, equation 1.5.21a).
TEST(Jones, SPolarisedLightGainsWhatFresnelSays) {
  const double figures[][2] = {{30, 0.39}, {45, 0.83}};
  for (const auto& [incidence, figure] : figures) {
    const Eigen::Vector3d light = on_arc(incidence);
    const Eigen::Vector3d view = on_arc(-incidence);
    const double gain =
        power(reflected_by_dielectric(polarised_beam(light, kY, kPerfect), light, view, 1.5));
    EXPECT_NEAR(gain - 1, figure, 0.005);
    const double i = incidence * kDegree;
    const double t = std::asin(std::sin(i) / 1.5);
    const double r_s = -std::sin(i - t) / std::sin(i + t);
    const double r_p = std::tan(i - t) / std::tan(i + t);
    EXPECT_NEAR(gain, 2 * r_s * r_s / (r_s * r_s + r_p * r_p), kRounding);
  }
}

TEST(Jones, LightBetweenSAndPTurnsUpInTheCrossPicture) {
  const double figures[][2] = {{30, 0.04}, {45, 0.22}, {60, 0.60}};
  for (const auto& [incidence, figure] : figures) {
    const Eigen::Vector3d light = on_arc(incidence);
    const Eigen::Vector3d view = on_arc(-incidence);
    // Half-way between s and p across light and view alike.
    const Eigen::Vector3d axis =
        Eigen::Vector3d(1 / std::cos(incidence * kDegree), 1, 0).normalized();
    const Beam beam =
        reflected_by_dielectric(polarised_beam(light, axis, kPerfect), light, view, 1.5);
    EXPECT_NEAR(power(beam), 1, kRounding);
    EXPECT_NEAR(Analyser(view, axis, 90 * kDegree, kPerfect).passed(beam), figure, 0.005)
        << incidence;
  }
}

TEST(Jones, GrazingLightIsReflectedWhole) {
  const Eigen::Vector3d light = on_arc(89.9999);
  const Eigen::Vector3d view = on_arc(-89.9999);
  for (const Eigen::Vector3d& axis : {kY, kZ}) {
    const double gain =
        power(reflected_by_dielectric(polarised_beam(light, axis, kPerfect), light, view, 1.5));
    EXPECT_NEAR(gain, 1, 1e-4) << axis.transpose();
  }
}

}  // namespace
}  // namespace veneer::simulation::studio
