// SPDX-License-Identifier: Apache-2.0
// The studio's fields against capture's Mueller matrices: two ways to say what polarised light
// does, which share no code.
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "capture/polarisation/mueller.h"
#include "simulation/studio/jones.h"

namespace veneer::simulation::studio {
namespace {

constexpr double kRounding = 1e-12;

Eigen::Vector3d random_direction(Pcg32& random) {
  return Eigen::Vector3d(
             2 * random.uniform() - 1, 2 * random.uniform() - 1, random.uniform() + 0.02)
      .normalized();
}

TEST(Agreement, FieldsAndMuellerMatricesSayTheSameOfAFacet) {
  Pcg32 random(5);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d light = random_direction(random);
    const Eigen::Vector3d view = random_direction(random);
    const Eigen::Vector3d axis = random_direction(random);
    if (axis.cross(light).norm() < 0.05 || axis.cross(view).norm() < 0.05) continue;
    const double index = 1.1 + 2 * random.uniform();
    const double light_extinction = 1 + 100 * random.uniform();
    const double extinction = 1 + 100 * random.uniform();
    const double angle = 7 * random.uniform();

    const auto facet = capture::facet_reflection(light, view, axis, axis, index);
    ASSERT_TRUE(facet) << facet.error().what;
    capture::Stokes sent = capture::polariser(0, light_extinction).col(0);
    sent /= sent[0];
    const capture::Stokes seen = capture::polariser(angle, extinction) * (*facet * sent);
    const double reflectance =
        capture::fresnel_amplitudes(std::sqrt(0.5 * (1 + light.dot(view))), index)
            .mean_reflectance();

    const Beam mirrored =
        reflected_by_dielectric(polarised_beam(light, axis, light_extinction), light, view, index);
    EXPECT_NEAR(
        Analyser(view, axis, angle, extinction).passed(mirrored), seen[0] / reflectance, kRounding)
        << "light " << light.transpose() << ", view " << view.transpose() << ", axis "
        << axis.transpose() << ", index " << index << ", angle " << angle;
  }
}

}  // namespace
}  // namespace veneer::simulation::studio
