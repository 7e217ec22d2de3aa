// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/stokes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "capture/polarisation/mosaic.h"
#include "capture/polarisation/mueller.h"

namespace veneer::capture {
namespace {

using std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kRounding = 1e-12;

const std::vector<std::vector<double>> kAngleSets{
    {0, pi / 4, pi / 2, 3 * pi / 4}, {0, pi / 3, 2 * pi / 3}, {-0.3, 0.4, 1.1, 1.9, 2.2, 7.0}};

std::vector<double> readings_of(const Stokes& light,
                                const std::vector<double>& angles,
                                double extinction) {
  std::vector<double> readings;
  for (const double angle : angles) readings.push_back((polariser(angle, extinction) * light)[0]);
  return readings;
}

TEST(StokesSolver, RecoversLightSeenThroughAnyAnalyser) {
  Pcg32 random(1);
  for (const std::vector<double>& angles : kAngleSets) {
    for (const double extinction : {1.5, 10.0, 300.0, kInfinity}) {
      const auto solver = StokesSolver::create(angles, extinction);
      ASSERT_TRUE(solver) << solver.error().what;
      for (int i = 0; i < 20; ++i) {
        const Stokes light(1, random.uniform() - 0.5, random.uniform() - 0.5, 0.3);
        const auto readings = readings_of(light, angles, extinction);
        const LinearStokes found = solver->solve(readings);
        EXPECT_LT((found - light.head<3>()).norm(), kRounding) << extinction;
        EXPECT_LT(solver->residual(readings, found), kRounding);
      }
    }
  }
}

TEST(StokesSolver, OfFourAnglesIsTheTextbooksSums) {
  const std::vector<double> angles(mosaic_angles().begin(), mosaic_angles().end());
  const auto solver = StokesSolver::create(angles, kInfinity);
  ASSERT_TRUE(solver);
  const std::vector<double> readings{7, 3, 2, 11};
  const LinearStokes found = solver->solve(readings);
  EXPECT_NEAR(found[0], 0.5 * (7 + 3 + 2 + 11), kRounding);
  EXPECT_NEAR(found[1], 7 - 2, kRounding);
  EXPECT_NEAR(found[2], 3 - 11, kRounding);
  // What four angles say twice: both pairs at right angles have the same sum.
  EXPECT_NEAR(solver->residual(readings, found), std::abs((7 + 2) - (3 + 11)) / 4.0, kRounding);
}

TEST(StokesSolver, LeavesNoResidualOfThreeAngles) {
  const auto solver = StokesSolver::create(kAngleSets[1], 50);
  ASSERT_TRUE(solver);
  const std::vector<double> readings{3, -1, 8};
  EXPECT_NEAR(solver->residual(readings, solver->solve(readings)), 0, kRounding);
}

TEST(StokesSolver, CovarianceIsThatOfTheParameters) {
  constexpr int kRuns = 40000;
  // Variances of 40000 runs deviate by sqrt(2 / 40000) = 0.7 %; four times that.
  constexpr double kTolerance = 0.03;
  for (const std::vector<double>& angles : kAngleSets) {
    const auto solver = StokesSolver::create(angles, 20);
    ASSERT_TRUE(solver);
    std::vector<double> variance;
    for (std::size_t i = 0; i < angles.size(); ++i)
      variance.push_back(0.5 + static_cast<double>(i));
    Pcg32 random(7);
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    std::vector<double> noise(angles.size());
    for (int run = 0; run < kRuns; ++run) {
      for (std::size_t i = 0; i < noise.size(); ++i)
        noise[i] = std::sqrt(variance[i]) * random.normal();
      const LinearStokes found = solver->solve(noise);
      sum += found * found.transpose();
    }
    const Eigen::Matrix3d expected = solver->covariance(variance);
    EXPECT_LT((sum / kRuns - expected).norm(), kTolerance * expected.norm());
  }
}

TEST(StokesSolver, RefusesAnglesThatSayTooLittle) {
  const double degree = pi / 180;
  for (const std::vector<double>& angles : {std::vector<double>{},
                                            {0, pi / 2},
                                            {0, pi / 4},
                                            {0, pi, 2 * pi},
                                            {0, pi, pi / 2},
                                            {0, pi / 4, pi / 4 + pi, -pi},
                                            {0, degree, 2 * degree}}) {
    const auto solver = StokesSolver::create(angles, kInfinity);
    ASSERT_FALSE(solver) << angles.size();
    EXPECT_EQ(solver.error().code, Errc::kInvalidOption);
    EXPECT_NE(solver.error().what.find("take 0, 45, 90 and 135"), std::string::npos);
  }
  EXPECT_FALSE(StokesSolver::create(std::vector<double>{0, 1, kNan}, kInfinity));
  EXPECT_FALSE(StokesSolver::create(std::vector<double>{0, 1, kInfinity}, kInfinity));
}

TEST(StokesSolver, RefusesAnAnalyserThatIsNone) {
  for (const double extinction : {1.0, 0.5, 0.0, -3.0, kNan}) {
    const auto solver = StokesSolver::create(kAngleSets[0], extinction);
    ASSERT_FALSE(solver);
    EXPECT_NE(solver.error().what.find("not above 1"), std::string::npos) << solver.error().what;
  }
}

TEST(Polarisation, DegreeAndAngleAreThoseOfMixedLight) {
  for (const double degree : {0.0, 0.2, 1.0}) {
    for (double angle = 0; angle < pi; angle += 0.1) {
      const Stokes light =
          3 * (degree * polarised_light(angle) + (1 - degree) * Stokes(1, 0, 0, 0));
      EXPECT_NEAR(degree_of_polarisation(light.head<3>()), degree, kRounding);
      if (degree > 0) {
        EXPECT_NEAR(angle_of_polarisation(light.head<3>()), angle, kRounding);
      }
    }
  }
}

TEST(Polarisation, IsDefinedWithoutLight) {
  EXPECT_EQ(degree_of_polarisation({0, 0, 0}), 0);
  EXPECT_EQ(degree_of_polarisation({-1, 1, 0}), 0);
  EXPECT_EQ(degree_of_polarisation({kNan, 1, 0}), 0);
  EXPECT_EQ(angle_of_polarisation({0, 0, 0}), 0);
  EXPECT_GT(degree_of_polarisation({1, 1, 1}), 1);  // noise is not cut
}

TEST(Polarisation, AnglesStayBelowHalfATurn) {
  for (const double s2 : {-1e-300, -1e-20, -1e-16, -0.0, 0.0, 1e-300}) {
    for (const double s1 : {-1.0, 1.0}) {
      const double angle = angle_of_polarisation({1, s1, s2});
      EXPECT_GE(angle, 0) << s1 << " " << s2;
      EXPECT_LT(angle, pi) << s1 << " " << s2;
    }
  }
}

}  // namespace
}  // namespace veneer::capture
