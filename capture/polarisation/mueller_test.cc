// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/mueller.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"

namespace veneer::capture {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = pi / 180;
/// Products of a few matrices of size 1.
constexpr double kRounding = 1e-13;

Vector3d random_direction(Pcg32& random) {
  return Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}
Vector3d random_upper(Pcg32& random) {
  Vector3d direction = random_direction(random);
  direction.z() = std::abs(direction.z()) + 0.01;
  return direction.normalized();
}

TEST(Polariser, FollowsMalusWithFiniteExtinction) {
  for (const double extinction : {1.0, 2.0, 100.0, kInfinity}) {
    const double leak = 1 / extinction;
    for (double axis = -3; axis < 3; axis += 0.37) {
      for (double field = 0; field < pi; field += 0.11) {
        const double cosine = std::cos(field - axis);
        const double passed = (polariser(axis, extinction) * polarised_light(field))[0];
        EXPECT_NEAR(passed, (1 - leak) * cosine * cosine + leak, kRounding);
      }
    }
  }
}

TEST(Polariser, BothPicturesAtRightAnglesHoldAllLight) {
  Pcg32 random(2);
  for (const double extinction : {1.0, 3.0, 100.0, kInfinity}) {
    for (int i = 0; i < 50; ++i) {
      const Stokes light(2, random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
      const double angle = 7 * random.uniform();
      const double both = (polariser(angle, extinction) * light)[0] +
                          (polariser(angle + pi / 2, extinction) * light)[0];
      EXPECT_NEAR(both, (1 + 1 / extinction) * light[0], kRounding) << angle;
    }
  }
}

TEST(Polariser, WithoutExtinctionDoesNothingAndAPerfectOneIsAProjection) {
  EXPECT_LT((polariser(0.7, 1) - Mueller::Identity()).norm(), kRounding);
  const Mueller perfect = polariser(0.7, kInfinity);
  EXPECT_LT((perfect * perfect - perfect).norm(), kRounding);
  EXPECT_LT((perfect * polariser(0.7 + pi / 2, kInfinity)).norm(), kRounding);
}

TEST(Polariser, NeverMakesLightAndNeverPolarisesBeyondAll) {
  Pcg32 random(3);
  for (int i = 0; i < 500; ++i) {
    const Vector3d polarised = random.uniform() * random_direction(random);
    const Stokes light(1, polarised.x(), polarised.y(), polarised.z());
    const Stokes out = polariser(7 * random.uniform(), 1 + 50 * random.uniform()) * light;
    EXPECT_LE(out[0], 1 + kRounding);
    EXPECT_LE(out.tail<3>().norm(), out[0] + kRounding);
  }
}

TEST(TurnedBasis, ComposesAndTurnsLightBack) {
  for (double a = -2; a < 2; a += 0.3) {
    for (double b = -2; b < 2; b += 0.3) {
      EXPECT_LT((turned_basis(a) * turned_basis(b) - turned_basis(a + b)).norm(), kRounding);
      EXPECT_LT((turned_basis(a) * polarised_light(b) - polarised_light(b - a)).norm(), kRounding);
    }
    EXPECT_LT((turned_basis(a) * turned_basis(-a) - Mueller::Identity()).norm(), kRounding);
    EXPECT_LT((turned_basis(a + pi) - turned_basis(a)).norm(), kRounding);  // an axis has no end
  }
}

TEST(Depolariser, LeavesNothingThatAnAnalyserCouldTell) {
  const Stokes light = depolariser() * polarised_light(0.4);
  EXPECT_EQ(light[0], 1);
  for (double angle = 0; angle < pi; angle += 0.2)
    EXPECT_NEAR((polariser(angle, 30) * light)[0], 0.5 * (1 + 1 / 30.0), kRounding);
}

TEST(Fresnel, SplitsAllEnergyBetweenReflectedAndRefracted) {
  for (const double index : {1.0, 1.33, 1.5, 2.4, 10.0}) {
    for (double incidence = 0; incidence < 89.9 * kDegree; incidence += kDegree) {
      const double cos_i = std::cos(incidence);
      const double cos_t = std::sqrt(1 - std::pow(std::sin(incidence) / index, 2));
      const FresnelAmplitudes r = fresnel_amplitudes(cos_i, index);
      // Fields are continuous along the interface, so the refracted amplitudes follow.
      const double t_s = 1 + r.s;
      const double t_p = (1 + r.p) / index;
      const double beam = index * cos_t / cos_i;
      EXPECT_NEAR(r.s_reflectance() + beam * t_s * t_s, 1, 1e-12) << incidence;
      EXPECT_NEAR(r.p_reflectance() + beam * t_p * t_p, 1, 1e-12) << incidence;
    }
  }
}

TEST(Fresnel, HasItsKnownPoints) {
  for (const double index : {1.2, 1.5, 2.0}) {
    const double normal = std::pow((index - 1) / (index + 1), 2);
    const FresnelAmplitudes at_normal = fresnel_amplitudes(1, index);
    EXPECT_NEAR(at_normal.s_reflectance(), normal, kRounding);
    EXPECT_NEAR(at_normal.s, -at_normal.p, kRounding);
    EXPECT_LT(at_normal.s, 0);  // half a wave is lost at the denser medium
    const double brewster = std::atan(index);
    EXPECT_NEAR(fresnel_amplitudes(std::cos(brewster), index).p, 0, kRounding);
    EXPECT_GT(fresnel_amplitudes(std::cos(brewster - 0.01), index).p, 0);
    EXPECT_LT(fresnel_amplitudes(std::cos(brewster + 0.01), index).p, 0);
    const FresnelAmplitudes grazing = fresnel_amplitudes(0, index);
    EXPECT_EQ(grazing.s_reflectance(), 1);
    EXPECT_EQ(grazing.p_reflectance(), 1);
  }
}

TEST(Fresnel, CutsTheCosineAndBearsNoInterface) {
  EXPECT_EQ(fresnel_amplitudes(1.5, 1.5).s, fresnel_amplitudes(1, 1.5).s);
  EXPECT_EQ(fresnel_amplitudes(-1, 1.5).s_reflectance(), 1);
  for (const double cosine : {0.0, 1e-9, 0.3, 1.0})
    EXPECT_NEAR(fresnel_amplitudes(cosine, 1).mean_reflectance(), 0, kRounding);
}

TEST(FacetReflection, AgreesWithTheFieldsFollowedInSpace) {
  Pcg32 random(4);
  for (int i = 0; i < 500; ++i) {
    const Vector3d light = random_upper(random);
    const Vector3d view = random_upper(random);
    const Vector3d light_axis = random_direction(random);
    const Vector3d view_axis = random_direction(random);
    const auto reflection = facet_reflection(light, view, light_axis, view_axis, 1.5);
    ASSERT_TRUE(reflection) << reflection.error().what;

    // The field itself: its part across the plane of incidence and its part in it.
    const auto across = [](const Vector3d& axis, const Vector3d& ray) {
      return Vector3d((axis - axis.dot(ray) * ray).normalized());
    };
    const Vector3d normal = (light + view).normalized();
    const FresnelAmplitudes r = fresnel_amplitudes(normal.dot(light), 1.5);
    const Vector3d s = light.cross(view).normalized();
    const Vector3d p_in = s.cross(-light);
    const Vector3d p_out = s.cross(view);
    for (const double turn : {0.0, 0.4, 1.3}) {
      const Vector3d x = across(light_axis, light);
      const Vector3d field = Eigen::AngleAxisd(turn, -light) * x;  // ccw for who looks to the light
      const Vector3d out = r.s * field.dot(s) * s + r.p * field.dot(p_in) * p_out;
      for (const double analyser : {0.0, 0.9, 2.0}) {
        const Vector3d passed = Eigen::AngleAxisd(analyser, view) * across(view_axis, view);
        const double expected = std::pow(out.dot(passed), 2);
        const double found =
            (polariser(analyser, kInfinity) * *reflection * polarised_light(turn))[0];
        EXPECT_NEAR(found, expected, 1e-12)
            << "light " << light.transpose() << " view " << view.transpose();
      }
    }
  }
}

TEST(FacetReflection, IsReciprocal) {
  // Who looks against the light sees its other side: the sign of what is at 45 degrees changes.
  const Eigen::DiagonalMatrix<double, 4> other_side(1, 1, -1, 1);
  Pcg32 random(5);
  for (int i = 0; i < 200; ++i) {
    const Vector3d a = random_upper(random);
    const Vector3d b = random_upper(random);
    const Vector3d a_axis = random_direction(random);
    const Vector3d b_axis = random_direction(random);
    const auto forth = facet_reflection(a, b, a_axis, b_axis, 1.7);
    const auto back = facet_reflection(b, a, b_axis, a_axis, 1.7);
    ASSERT_TRUE(forth);
    ASSERT_TRUE(back);
    EXPECT_LT((other_side * forth->transpose() * other_side - *back).norm(), kRounding);
  }
}

TEST(FacetReflection, IsContinuousWhereLightGoesBackToTheView) {
  const Vector3d view = Vector3d(0.2, -0.3, 1).normalized();
  const Vector3d axis(0, 1, 0);
  const auto at = facet_reflection(view, view, axis, axis, 1.5);
  ASSERT_TRUE(at);
  for (const double step : {1e-3, 1e-6, 1e-8, 1e-10, 1e-12}) {
    for (double azimuth = 0; azimuth < 6.2; azimuth += 0.5) {
      const Vector3d light =
          (view + step * Vector3d(std::cos(azimuth), std::sin(azimuth), 0)).normalized();
      const auto near = facet_reflection(light, view, axis, axis, 1.5);
      ASSERT_TRUE(near);
      // The reflectance is flat there, and the bases turn by no more than the step.
      EXPECT_LT((*near - *at).norm(), 2 * step + kRounding) << step << " " << azimuth;
    }
  }
}

TEST(FacetReflection, KeepsThePolarisationAtNormalIncidenceHoweverBothAxesTurn) {
  const Vector3d view(0, 0, 1);
  const double reflectance = 0.04;  // of index 1.5
  for (double turn = 0; turn < pi; turn += 0.1) {
    const Vector3d axis(std::cos(turn), std::sin(turn), 0);
    const auto reflection = facet_reflection(view, view, axis, axis, 1.5);
    ASSERT_TRUE(reflection);
    for (const double angle : {0.0, 0.3, 1.2, pi / 2}) {
      const double cosine = std::cos(angle);
      EXPECT_NEAR((polariser(angle, kInfinity) * *reflection * polarised_light(0))[0],
                  reflectance * cosine * cosine,
                  kRounding);
    }
  }
}

TEST(FacetReflection, IsAMirrorAtGrazing) {
  // Both amplitudes are -1 there: all light goes on, polarised as it was.
  const double angle = 89.99 * kDegree;
  const Vector3d light(std::sin(angle), 0, std::cos(angle));
  const Vector3d view(-std::sin(angle), 0, std::cos(angle));
  const auto reflection = facet_reflection(light, view, {0, 1, 0}, {0, 1, 0}, 1.5);
  ASSERT_TRUE(reflection);
  EXPECT_LT((*reflection - Mueller::Identity()).norm(), 0.01);
}

TEST(FacetReflection, RefusesWhatHasNoPlane) {
  const Vector3d up(0, 0, 1);
  const Vector3d side(1, 0, 0);
  const Vector3d axis(0, 1, 0);
  const auto refused = [](const Result<Mueller>& result, const std::string& text) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::kInvalidOption);
    EXPECT_NE(result.error().what.find(text), std::string::npos) << result.error().what;
  };
  refused(facet_reflection(axis, up, axis, axis, 1.5), "axis of the light");
  refused(facet_reflection(up, -axis, axis, axis, 1.5), "axis of the view");
  refused(facet_reflection(up, up, {0, 0, 0}, axis, 1.5), "axis of the light");
  refused(facet_reflection(up, up, axis, {kNan, 0, 1}, 1.5), "axis of the view");
  refused(facet_reflection(side, -side, axis, axis, 1.5), "opposite");
  refused(facet_reflection({0, 0, 0}, up, axis, axis, 1.5), "no length");
  refused(facet_reflection(up, {kNan, 0, 1}, axis, axis, 1.5), "no length");
  for (const double index : {0.9, -1.0, 0.0, kNan, kInfinity})
    refused(facet_reflection(up, up, axis, axis, index), "not at least 1");
}

}  // namespace
}  // namespace veneer::capture
