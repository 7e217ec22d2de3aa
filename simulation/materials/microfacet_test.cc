// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/microfacet.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"

namespace veneer::simulation {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

// Integral over the upper hemisphere of f(direction), midpoint rule in theta and phi.
template <class F>
double hemisphere_integral(const F& f, int thetas = 512, int phis = 128) {
  double sum = 0.0;
  for (int i = 0; i < thetas; ++i) {
    const double theta = (i + 0.5) * 0.5 * kPi / thetas;
    for (int k = 0; k < phis; ++k)
      sum += f(direction(theta, (k + 0.5) * 2.0 * kPi / phis)) * std::sin(theta);
  }
  return sum * (0.5 * kPi / thetas) * (2.0 * kPi / phis);
}

// The interface's reflection D G F / (4 cos cos) with F = 1, times the light's cosine.
double white_interface(const Eigen::Vector3d& view, const Eigen::Vector3d& light, float alpha) {
  const Eigen::Vector3d middle = (view + light).normalized();
  const auto cos_l = static_cast<float>(light.z());
  const auto cos_v = static_cast<float>(view.z());
  return cos_l * ggx_ndf(static_cast<float>(middle.z()), alpha) *
         smith_visibility(cos_l, smith_root(cos_l, alpha), cos_v, smith_root(cos_v, alpha));
}

TEST(GgxNdf, ProjectsToUnitArea) {
  // Measured with 4,096 midpoints in theta: 4e-6 at alpha 0.05, less above; the rest is float.
  constexpr double kTolerance = 2e-5;
  for (const float alpha : {0.05F, 0.1F, 0.3F, 0.6F, 1.0F}) {
    const double area = hemisphere_integral(
        [&](const Eigen::Vector3d& m) { return ggx_ndf(static_cast<float>(m.z()), alpha) * m.z(); },
        4096,
        1);
    EXPECT_NEAR(area, 1.0, kTolerance) << alpha;
  }
}

TEST(SmithVisibility, IsSymmetricFiniteAndNeverMasksLessThanNothing) {
  for (const float alpha : {0.03F, 0.3F, 1.0F}) {
    for (const float a : {1e-4F, 0.02F, 0.5F, 1.0F}) {
      for (const float b : {0.0F, 1e-4F, 0.3F, 1.0F}) {
        const float visibility = smith_visibility(a, smith_root(a, alpha), b, smith_root(b, alpha));
        EXPECT_TRUE(std::isfinite(visibility)) << a << ' ' << b << ' ' << alpha;
        EXPECT_EQ(visibility, smith_visibility(b, smith_root(b, alpha), a, smith_root(a, alpha)));
        EXPECT_LE(4.0F * a * b * visibility, 1.0F + 1e-6F) << a << ' ' << b << ' ' << alpha;
      }
    }
  }
}

TEST(SampleVisibleNormal, ReflectsAsMuchAsTheIntegralSays) {
  constexpr int kSamples = 20000;
  // Four standard errors of a mean of numbers in [0, 1], and the quadrature's error.
  const double tolerance = 4.0 * 0.5 / std::sqrt(kSamples) * 0.5 + 1e-3;
  Pcg32 random(7);
  for (const float alpha : {0.1F, 0.35F, 0.9F}) {
    for (const double theta_deg : {0.0, 30.0, 60.0, 80.0}) {
      const Eigen::Vector3d view = direction(theta_deg * kPi / 180.0, 0.7);
      const double expected = hemisphere_integral(
          [&](const Eigen::Vector3d& light) { return white_interface(view, light, alpha); },
          1024,
          256);
      double sum = 0.0;
      for (int i = 0; i < kSamples; ++i) {
        const double u1 = random.uniform();
        const Eigen::Vector3d facet = sample_visible_normal(view, alpha, u1, random.uniform());
        ASSERT_NEAR(facet.norm(), 1.0, 1e-12);
        ASSERT_GE(facet.z(), 0.0);
        const Eigen::Vector3d light = 2.0 * view.dot(facet) * facet - view;
        if (light.z() > 0.0)
          sum += masking_ratio(static_cast<float>(view.z()), static_cast<float>(light.z()), alpha);
      }
      EXPECT_NEAR(sum / kSamples, expected, tolerance)
          << "alpha " << alpha << ", " << theta_deg << " deg";
    }
  }
}

TEST(Fresnel, IsF0AtTheNormalOneAtGrazingAndNothingWithoutAnInterface) {
  const Eigen::Vector3f glass = Eigen::Vector3f::Constant(0.04F);
  EXPECT_FLOAT_EQ(fresnel(glass, 1.0F)[0], 0.04F);
  EXPECT_FLOAT_EQ(fresnel(glass, 0.0F)[0], 1.0F);
  for (const float cosine : {0.0F, 0.3F, 1.0F}) {
    EXPECT_EQ(fresnel(Eigen::Vector3f::Zero(), cosine).maxCoeff(), 0.0F) << cosine;
  }
}

TEST(WholeReflection, NeverExceedsWhatArrives) {
  constexpr double kQuadrature = 2e-3;  // measured at the sharpest lobe below
  for (const float f0 : {0.0F, 0.04F, 0.3F, 1.0F}) {
    const Eigen::Vector3f rgb = Eigen::Vector3f::Constant(f0);
    for (const float alpha : {0.1F, 0.3F, 0.7F, 1.0F}) {
      for (const double theta_deg : {0.0, 45.0, 75.0, 89.0}) {
        const Eigen::Vector3d view = direction(theta_deg * kPi / 180.0, 0.2);
        const float out = 1.0F - fresnel(rgb, static_cast<float>(view.z()))[0];
        const double reflected = hemisphere_integral([&](const Eigen::Vector3d& light) {
          const auto cos_m = static_cast<float>(view.dot((view + light).normalized()));
          const float in = 1.0F - fresnel(rgb, static_cast<float>(light.z()))[0];
          return white_interface(view, light, alpha) * fresnel(rgb, std::min(1.0F, cos_m))[0] +
                 light.z() * in * out / kPi;
        });
        EXPECT_LE(reflected, 1.0 + kQuadrature)
            << "f0 " << f0 << ", alpha " << alpha << ", " << theta_deg << " deg";
      }
    }
  }
}

}  // namespace
}  // namespace veneer::simulation
