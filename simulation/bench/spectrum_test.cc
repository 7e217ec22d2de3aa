// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>

namespace veneer::simulation {
namespace {

TEST(XyzOf, EqualEnergyIsNeutral) {
  const Xyz xyz = xyz_of(Spectrum::Ones());
  constexpr double kCutEnds =
      3e-3;  // what 400 to 700 nm leaves out differs by function; measured 2.9e-3
  EXPECT_NEAR(xyz.x() / xyz.y(), 1.0, kCutEnds);
  EXPECT_NEAR(xyz.z() / xyz.y(), 1.0, kCutEnds);
}

TEST(XyzOf, AWattAtThePeakOfVisionIs683Lumens) {
  Spectrum line = Spectrum::Zero();
  line[15] = 0.5 / 10.0;  // half a watt each at 550 and 560 nm, in bands of 10 nm
  line[16] = 0.5 / 10.0;
  EXPECT_NEAR(xyz_of(line).y(), 0.995 * 683.0, 1e-9);  // V(550) = V(560) = 0.995
}

TEST(PlanckianSpectrum, HasTheChromaticityOfIlluminantA) {
  const Xyz xyz = xyz_of(planckian_spectrum(2855.5));
  constexpr double kCutEnds = 2e-3;  // most of what is missing lies beyond 700 nm
  EXPECT_NEAR(xyz.x() / xyz.sum(), 0.44757, kCutEnds);
  EXPECT_NEAR(xyz.y() / xyz.sum(), 0.40745, kCutEnds);
}

TEST(PlanckianSpectrum, ObeysWiensDisplacementLaw) {
  for (const double kelvin : {4400.0, 5000.0, 6000.0, 7000.0}) {
    const Spectrum s = planckian_spectrum(kelvin);
    int peak = 0;
    s.maxCoeff(&peak);
    EXPECT_NEAR(wavelength_nm(peak), 2.897772e6 / kelvin, 10.0) << kelvin;  // one band
  }
}

TEST(GaussianSpectrum, IsOneAtItsCentreAndHalfAtItsHalfWidth) {
  const double sigma = 30.0 / std::sqrt(2 * std::log(2.0));
  const Spectrum s = gaussian_spectrum(550, sigma);
  EXPECT_NEAR(s[15], 1.0, 1e-12);
  EXPECT_NEAR(s[12], 0.5, 1e-12);
  EXPECT_NEAR(s[18], 0.5, 1e-12);
}

TEST(InterpolatedSpectrum, PassesThroughItsPointsAndStaysConstantBeyond) {
  const Spectrum s = interpolated_spectrum({450, 550, 650}, {0.2, 0.6, 0.5});
  EXPECT_NEAR(s[0], 0.2, 1e-12);
  EXPECT_NEAR(s[5], 0.2, 1e-12);
  EXPECT_NEAR(s[10], 0.4, 1e-12);
  EXPECT_NEAR(s[15], 0.6, 1e-12);
  EXPECT_NEAR(s[20], 0.55, 1e-12);
  EXPECT_NEAR(s[30], 0.5, 1e-12);
  EXPECT_TRUE((interpolated_spectrum({550}, {0.7}) == 0.7).all());
}

}  // namespace
}  // namespace veneer::simulation
