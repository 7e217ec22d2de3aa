// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/separation.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include "base/random.h"
#include "capture/polarisation/mueller.h"

namespace veneer::capture {
namespace {

using Eigen::Array3d;
using Eigen::Vector3d;
using std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = pi / 180;
/// A few divisions of values around 1 by contrasts of 0.1 and more.
constexpr double kRounding = 1e-11;

struct Rig {
  double light_extinction = kInfinity;
  double analyser_extinction = kInfinity;
  double misalignment_rad = 0;
  double cross_gain = 1;
  [[nodiscard]] RigPolarisation known() const {
    const double leak = 1 / light_extinction;
    return {(1 - leak) / (1 + leak), misalignment_rad};
  }
};
Rig random_rig(Pcg32& random) {
  return {1 / (0.4 * random.uniform()),
          1 / (0.4 * random.uniform()),
          (random.uniform() - 0.5) * 20 * kDegree,
          0.8 + 0.4 * random.uniform()};
}
std::ostream& operator<<(std::ostream& stream, const Rig& rig) {
  return stream << rig.light_extinction << ":1, " << rig.analyser_extinction << ":1, "
                << rig.misalignment_rad / kDegree << " degrees, gain " << rig.cross_gain;
}

struct Pictures {
  Array3d parallel = Array3d::Zero();
  Array3d cross = Array3d::Zero();
};
/// What a rig's camera reads of a surface.
Pictures pictures_of(const Mueller& surface, const Rig& rig) {
  const Stokes light = surface * polariser(0, rig.light_extinction) * Stokes(1, 0, 0, 0);
  const auto reading = [&](double angle) {
    return Array3d(Array3d::Constant(
        (polariser(angle + rig.misalignment_rad, rig.analyser_extinction) * light)[0]));
  };
  return {reading(0), rig.cross_gain * reading(pi / 2)};
}
/// A metal mirror that faces both: nothing but the other side of the light.
Mueller mirror() { return Eigen::Vector4d(1, 1, -1, -1).asDiagonal(); }

Contrasts measured(const Rig& rig) {
  const Pictures shiny = pictures_of(mirror(), rig);
  const Pictures dull = pictures_of(depolariser(), rig);
  auto contrasts = Contrasts::measure(shiny.parallel, shiny.cross, dull.parallel, dull.cross);
  EXPECT_TRUE(contrasts) << contrasts.error().what << " " << rig;
  return contrasts.value_or(Contrasts{});
}
Parts separated(const Pictures& pictures, const Contrasts& contrasts) {
  return separate(pictures.parallel, pictures.cross, Array3d::Ones(), Array3d::Ones(), contrasts);
}
/// P + C of the depolariser: what counts as 1.
double white_of(const Rig& rig) {
  const Pictures dull = pictures_of(depolariser(), rig);
  return dull.parallel[0] + dull.cross[0];
}

/// Light and view on both sides of a facet's normal, with this incidence, and an axis in the facet
/// whose projection across either ray has this azimuth from s.
struct Geometry {
  Vector3d view;
  Vector3d light;
  PolarisationAxes axes;
};
Geometry geometry_at(double incidence_rad, double azimuth_rad) {
  Geometry geometry;
  geometry.light = {std::sin(incidence_rad), 0, std::cos(incidence_rad)};
  geometry.view = {-std::sin(incidence_rad), 0, std::cos(incidence_rad)};
  // s is along y; what is in the plane of incidence is seen shortened by the cosine.
  geometry.axes.axis =
      Vector3d(std::sin(azimuth_rad) / std::cos(incidence_rad), std::cos(azimuth_rad), 0);
  geometry.axes.axis.normalize();
  return geometry;
}
Mueller facet(const Geometry& geometry, double index) {
  const auto reflection = facet_reflection(
      geometry.light, geometry.view, geometry.axes.axis, geometry.axes.axis, index);
  EXPECT_TRUE(reflection);
  return reflection.value_or(Mueller::Zero());
}
FresnelPrediction predicted(const Geometry& geometry, double index) {
  auto prediction = predict_fresnel(geometry.view, geometry.light, geometry.axes, index);
  EXPECT_TRUE(prediction);
  return prediction.value_or(FresnelPrediction{});
}

TEST(Separation, RecoversBothPartsExactlyWhateverThePolarisers) {
  Pcg32 random(1);
  for (int i = 0; i < 300; ++i) {
    const Rig rig = random_rig(random);
    const double specular = 3 * random.uniform();
    const double diffuse = random.uniform();
    const Pictures pictures = pictures_of(specular * mirror() + diffuse * depolariser(), rig);
    const Parts parts = separated(pictures, measured(rig));
    EXPECT_NEAR(parts.specular[0] / white_of(rig), specular, kRounding) << rig;
    EXPECT_NEAR(parts.diffuse[1] / white_of(rig), diffuse, kRounding) << rig;
  }
}

TEST(Separation, OfPerfectPolarisersIsTheTextbooks) {
  const Array3d parallel(5, 2, 1);
  const Array3d cross(1, 0.5, 2);
  const Parts parts = separate(parallel, cross, Array3d::Ones(), Array3d::Ones(), Contrasts{});
  EXPECT_LT((parts.specular - (parallel - cross)).abs().maxCoeff(), kRounding);
  EXPECT_LT((parts.diffuse - 2 * cross).abs().maxCoeff(), kRounding);
  EXPECT_LT(parts.specular[2], 0);  // kept
}

TEST(Separation, LosesNoLight) {
  Pcg32 random(2);
  for (int i = 0; i < 50; ++i) {
    Rig rig = random_rig(random);
    rig.cross_gain = 1;
    const Pictures pictures = pictures_of(0.3 * mirror() + depolariser(), rig);
    const Parts parts = separated(pictures, measured(rig));
    EXPECT_LT(
        (parts.specular + parts.diffuse - pictures.parallel - pictures.cross).abs().maxCoeff(),
        kRounding);
  }
}

TEST(Separation, WithoutLeakCorrectionLeaksAsTheContrastSays) {
  for (const double extinction : {100.0, 1000.0, kInfinity}) {
    for (const double misalignment : {0.0, 1.0, 3.0, 5.0, 10.0, 20.0}) {
      const Rig rig{extinction, extinction, misalignment * kDegree, 1};
      const Parts parts = separated(pictures_of(mirror(), rig), Contrasts{});
      const double leak =
          0.5 * (1 - Contrasts::of_rig(extinction, extinction, misalignment * kDegree).specular[0]);
      EXPECT_NEAR(parts.specular[0] / white_of(rig), 1 - 2 * leak, kRounding) << rig;
      EXPECT_NEAR(parts.diffuse[0] / white_of(rig), 2 * leak, kRounding) << rig;
      // And to first order by the sum of three small things; their products are left out.
      const double sine = std::sin(misalignment * kDegree);
      const double first_order = 2 / extinction + sine * sine;
      EXPECT_NEAR(leak, first_order, 2 * first_order * first_order) << rig;
    }
  }
}

TEST(Separation, VariancesAreThoseOfTheParts) {
  constexpr int kRuns = 40000;
  // Variances of 40000 runs deviate by sqrt(2 / 40000) = 0.7 %; four times that.
  constexpr double kTolerance = 0.03;
  const Contrasts contrasts = measured({20, 30, 0.1, 1.1});
  const Array3d parallel_variance(1, 0.2, 0);
  const Array3d cross_variance(0.3, 2, 1);
  Pcg32 random(3);
  Array3d specular = Array3d::Zero();
  Array3d diffuse = Array3d::Zero();
  Parts expected;
  for (int run = 0; run < kRuns; ++run) {
    const auto noise = [&](const Array3d& variance) {
      const Array3d normal(random.normal(), random.normal(), random.normal());
      return Array3d(variance.sqrt() * normal);
    };
    expected = separate(noise(parallel_variance),
                        noise(cross_variance),
                        parallel_variance,
                        cross_variance,
                        contrasts);
    specular += expected.specular.square() / kRuns;
    diffuse += expected.diffuse.square() / kRuns;
  }
  EXPECT_LT((specular / expected.specular_variance - 1).abs().maxCoeff(), kTolerance);
  EXPECT_LT((diffuse / expected.diffuse_variance - 1).abs().maxCoeff(), kTolerance);
}

TEST(Separation, OfNoLightIsNothingAndOfNoNumberNone) {
  const Contrasts contrasts = measured({100, 100, 0.05, 1});
  const Parts dark =
      separate(Array3d::Zero(), Array3d::Zero(), Array3d::Zero(), Array3d::Zero(), contrasts);
  EXPECT_TRUE((dark.specular == 0).all());
  EXPECT_TRUE((dark.diffuse == 0).all());
  EXPECT_TRUE((dark.specular_variance == 0).all());
  const Parts bad =
      separate(Array3d(1, kNan, 1), Array3d::Ones(), Array3d::Ones(), Array3d::Ones(), contrasts);
  EXPECT_TRUE(std::isfinite(bad.specular[0]));
  EXPECT_TRUE(std::isnan(bad.specular[1]));  // this channel alone
  EXPECT_TRUE(std::isnan(bad.diffuse[1]));
  EXPECT_TRUE(std::isfinite(bad.diffuse[2]));
}

TEST(Separation, MasksAChannelThatCannotBeSeparated) {
  Contrasts contrasts;
  contrasts.specular = Array3d(1, 0.09, -0.5);
  const Parts parts =
      separate(Array3d::Ones(), Array3d::Ones(), Array3d::Ones(), Array3d::Ones(), contrasts);
  EXPECT_TRUE(std::isfinite(parts.specular[0]));
  EXPECT_TRUE(std::isnan(parts.specular[1]));
  EXPECT_TRUE(std::isnan(parts.diffuse[1]));
  EXPECT_EQ(parts.specular_variance[1], kInfinity);
  EXPECT_TRUE(std::isfinite(parts.specular[2]));  // a plane turned by more than 45 degrees
}

TEST(Contrasts, OfAMirrorAreThoseOfItsPolarisers) {
  Pcg32 random(4);
  for (int i = 0; i < 100; ++i) {
    const Rig rig = random_rig(random);
    const Contrasts known =
        Contrasts::of_rig(rig.light_extinction, rig.analyser_extinction, rig.misalignment_rad);
    const Contrasts found = measured(rig);
    // The gain of the cross picture is in both numbers and goes out of them again.
    EXPECT_NEAR(found.of_polarisers()[0], known.specular[0], kRounding) << rig;
    EXPECT_NEAR((1 - found.diffuse[0]) / (1 + found.diffuse[0]), rig.cross_gain, kRounding);
  }
}

TEST(Contrasts, DeviationIsThatOfTheLight) {
  constexpr int kRuns = 40000;
  const Array3d parallel(10, 10, 0.5);
  const Array3d cross(0.2, 9, 10);
  // Small against the light: the formula is of first order.
  const Array3d parallel_variance(0.01, 0.02, 0.001);
  const Array3d cross_variance(0.001, 0.01, 0.02);
  Pcg32 random(5);
  Array3d sum = Array3d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    const auto noisy = [&](const Array3d& light, const Array3d& variance) {
      const Array3d normal(random.normal(), random.normal(), random.normal());
      return Array3d(light + variance.sqrt() * normal);
    };
    const Array3d p = noisy(parallel, parallel_variance);
    const Array3d c = noisy(cross, cross_variance);
    sum += ((p - c) / (p + c) - (parallel - cross) / (parallel + cross)).square() / kRuns;
  }
  const Array3d expected = contrast_deviation(parallel, cross, parallel_variance, cross_variance);
  EXPECT_LT((sum.sqrt() / expected - 1).abs().maxCoeff(), 0.02);
  const Array3d none = Array3d::Zero();
  EXPECT_TRUE((contrast_deviation(none, none, none, none) == kInfinity).all());
}

TEST(Contrasts, RefuseWhatCannotBeSeparated) {
  const Array3d one = Array3d::Ones();
  const Array3d none = Array3d::Zero();
  const auto refused = [](const Result<Contrasts>& result, const std::string& text) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::kBadFormat);
    EXPECT_NE(result.error().what.find(text), std::string::npos) << result.error().what;
  };
  refused(Contrasts::measure(none, none, one, one), "mirror sends no light");
  refused(Contrasts::measure(one, none, none, none), "target sends no light");
  refused(Contrasts::measure(Array3d(1, kNan, 1), none, one, one), "no light in green");
  refused(Contrasts::measure(kInfinity * one, none, one, one), "no light");
  refused(Contrasts::measure(one, 0.9 * one, one, one), "polariser is missing");
  refused(Contrasts::measure(none, one, one, one), "exchanged");
  refused(Contrasts::measure(one, none, one, 0.3 * one), "three times");
  // The least that is taken: a contrast of 0.1 and hardly more.
  EXPECT_TRUE(Contrasts::measure(1.11 * one, 0.9 * one, one, one));
}

TEST(FresnelPrediction, HasTheKnownFigures) {
  struct Figure {
    double incidence_deg, gain_percent, cross_percent;
  };
  for (const Figure& figure : {Figure{30, 39, 4}, Figure{45, 83, 22}}) {
    const double incidence = figure.incidence_deg * kDegree;
    EXPECT_NEAR(
        100 * (predicted(geometry_at(incidence, 0), 1.5).gain - 1), figure.gain_percent, 0.5);
    EXPECT_NEAR(100 * predicted(geometry_at(incidence, pi / 4), 1.5).cross_fraction,
                figure.cross_percent,
                0.5);
  }
  EXPECT_NEAR(100 * predicted(geometry_at(60 * kDegree, pi / 4), 1.5).cross_fraction, 60, 0.5);
}

TEST(FresnelPrediction, SaysWhatPicturesShow) {
  const Rig perfect;
  const Rig no_polarisers{1, 1, 0, 1};
  for (double incidence = 0; incidence < 81; incidence += 9) {
    for (double azimuth = 0; azimuth <= 90; azimuth += 7.5) {
      const Geometry geometry = geometry_at(incidence * kDegree, azimuth * kDegree);
      const FresnelPrediction prediction = predicted(geometry, 1.5);
      EXPECT_NEAR(prediction.incidence_rad, incidence * kDegree, kRounding);
      if (incidence > 0) {
        EXPECT_NEAR(prediction.azimuth_rad, azimuth * kDegree, kRounding);
      }
      const Mueller surface = facet(geometry, 1.5);
      const Pictures pictures = pictures_of(surface, perfect);
      const double both = pictures.parallel[0] + pictures.cross[0];
      if (both > 1e-6) {
        EXPECT_NEAR(prediction.cross_fraction, pictures.cross[0] / both, 1e-8);
      }
      // Of unpolarised light of power 1 the polariser leaves one half.
      const double unpolarised = pictures_of(surface, no_polarisers).parallel[0];
      EXPECT_NEAR(prediction.gain, both / (0.5 * unpolarised), kRounding);
    }
  }
}

TEST(FresnelPrediction, KeepsToItsRange) {
  for (const double index : {1.0, 1.0001, 1.5, 4.0}) {
    for (double incidence = 0; incidence < 90; incidence += 4.9) {
      for (double azimuth = 0; azimuth <= 90; azimuth += 15) {
        const FresnelPrediction prediction =
            predicted(geometry_at(incidence * kDegree, azimuth * kDegree), index);
        EXPECT_GE(prediction.gain, 0);
        EXPECT_LE(prediction.gain, 2);
        EXPECT_GE(prediction.cross_fraction, 0);
        EXPECT_LE(prediction.cross_fraction, 1);
        EXPECT_TRUE(prediction.mueller.allFinite()) << index << " " << incidence;
      }
    }
  }
  // p-polarised light at Brewster's angle: nothing comes back, nothing leaks.
  const FresnelPrediction brewster = predicted(geometry_at(std::atan(1.5), pi / 2), 1.5);
  EXPECT_NEAR(brewster.gain, 0, kRounding);
  EXPECT_EQ(brewster.cross_fraction, 0);
  EXPECT_TRUE(with_turned_plane(Contrasts{}, brewster).specular.allFinite());
  EXPECT_FALSE(unpolarised_specular(Array3d::Ones(), brewster));
}

TEST(FresnelPrediction, RefusesAnIndexBelowOneAndAxesAlongRays) {
  const PolarisationAxes axes;
  EXPECT_FALSE(predict_fresnel({0, 0, 1}, {0, 0, 1}, axes, 0.99));
  EXPECT_FALSE(predict_fresnel({0, 0, 1}, {0, 0, 1}, axes, kNan));
  EXPECT_FALSE(predict_fresnel({0, 0, 1}, {0, 1, 0}, axes, 1.5));
  EXPECT_FALSE(predict_fresnel({0, 1, 0}, {0, 0, 1}, axes, 1.5));
}

/// Specular and diffuse light at many geometries and azimuths.
template <class Visit>
void for_each_pair(const Visit& visit) {
  for (const double incidence : {0.0, 10.0, 30.0, 45.0, 60.0, 70.0, 80.0}) {
    for (double azimuth = 0; azimuth <= 180; azimuth += 10) {
      const Geometry geometry = geometry_at(incidence * kDegree, azimuth * kDegree);
      visit(geometry, predicted(geometry, 1.5));
    }
  }
}

TEST(TurnedPlane, IsPutBackExactlyForARigThatIsKnown) {
  Pcg32 random(6);
  int judged = 0;
  for (const Rig& rig :
       {Rig{}, Rig{kInfinity, 50, 0, 1.1}, random_rig(random), random_rig(random)}) {
    const Contrasts contrasts = measured(rig);
    for_each_pair([&](const Geometry& geometry, const FresnelPrediction& prediction) {
      const Contrasts turned = with_turned_plane(contrasts, prediction, rig.known());
      if (turned.of_polarisers().abs().minCoeff() < kLeastContrast) return;
      const Mueller surface = 5 * facet(geometry, 1.5);
      const Parts parts = separated(pictures_of(surface + 0.4 * depolariser(), rig), turned);
      const Stokes light = polariser(0, rig.light_extinction) * Stokes(1, 0, 0, 0);
      const double specular = (surface * light)[0] / light[0];
      EXPECT_NEAR(parts.specular[0] / white_of(rig), specular, kRounding) << rig;
      EXPECT_NEAR(parts.diffuse[0] / white_of(rig), 0.4, kRounding) << rig;
      ++judged;
      // And back to what unpolarised light would make.
      if (const auto unpolarised =
              unpolarised_specular(parts.specular / white_of(rig), prediction, rig.known())) {
        EXPECT_NEAR((*unpolarised)[0], surface(0, 0), 1e-9) << rig;
      }
    });
  }
  EXPECT_GT(judged, 300);  // of 532
}

TEST(TurnedPlane, ThatDoesNotTurnChangesNothing) {
  const Contrasts contrasts = measured({100, 50, 0.05, 0.97});
  const Contrasts same = with_turned_plane(contrasts, FresnelPrediction{});
  EXPECT_LT((same.specular - contrasts.specular).abs().maxCoeff(), kRounding);
}

TEST(PredictedError, OfPerfectPolarisersIsTwiceTheCrossFraction) {
  for_each_pair([&](const Geometry& geometry, const FresnelPrediction& prediction) {
    const Mueller surface = facet(geometry, 1.5);
    const Parts parts = separated(pictures_of(surface + depolariser(), Rig{}), Contrasts{});
    const double specular = surface(0, 0) + surface(0, 1);
    const PredictedError error = predicted_error(prediction, Contrasts{}, specular, 1, 0, 0);
    EXPECT_NEAR(error.specular, 2 * prediction.cross_fraction * specular, 1e-8);
    EXPECT_NEAR(std::abs(parts.specular[0] / white_of({}) - specular), error.specular, 1e-8);
    EXPECT_NEAR(std::abs(parts.diffuse[0] / white_of({}) - 1), error.diffuse, 1e-8);
  });
}

TEST(PredictedError, BoundsWhatAnyRigDoes) {
  Pcg32 random(7);
  std::vector<Rig> rigs{{100, 100, 3 * kDegree, 1}, {100, 100, -3 * kDegree, 1.02}};
  for (int i = 0; i < 30; ++i) rigs.push_back(random_rig(random));
  for (const Rig& rig : rigs) {
    const Contrasts contrasts = measured(rig);
    for_each_pair([&](const Geometry& geometry, const FresnelPrediction& prediction) {
      const Mueller surface = facet(geometry, 1.5);
      const Parts parts = separated(pictures_of(surface + depolariser(), rig), contrasts);
      const Stokes light = polariser(0, rig.light_extinction) * Stokes(1, 0, 0, 0);
      const double specular = (surface * light)[0] / light[0];
      const PredictedError error = predicted_error(prediction, contrasts, specular, 1, 0, 0);
      // The worst rig is sought in steps, which may pass it by a little.
      const double bound = 1.01 * error.specular + kRounding;
      EXPECT_LE(std::abs(parts.specular[0] / white_of(rig) - specular), bound) << rig;
      EXPECT_LE(std::abs(parts.diffuse[0] / white_of(rig) - 1), bound) << rig;
    });
  }
}

TEST(PredictedError, HoldsNoiseAndTheContrastsOwn) {
  const FresnelPrediction straight;
  const PredictedError noise = predicted_error(straight, Contrasts{}, 1, 1, 0.3, 0.4);
  EXPECT_NEAR(noise.specular, 0.3, kRounding);
  EXPECT_NEAR(noise.diffuse, 0.4, kRounding);

  constexpr int kRuns = 20000;
  Contrasts contrasts = measured({100, 100, 0.05, 1});
  contrasts.specular_deviation.setConstant(0.004);
  contrasts.diffuse_deviation.setConstant(0.003);
  const Pictures pictures = pictures_of(2 * mirror() + 0.7 * depolariser(), {100, 100, 0.05, 1});
  const double white = white_of({100, 100, 0.05, 1});
  Pcg32 random(8);
  double specular = 0;
  double diffuse = 0;
  for (int run = 0; run < kRuns; ++run) {
    Contrasts wrong = contrasts;
    wrong.specular += 0.004 * random.normal();
    wrong.diffuse += 0.003 * random.normal();
    const Parts parts = separated(pictures, wrong);
    specular += std::pow(parts.specular[0] / white - 2, 2) / kRuns;
    diffuse += std::pow(parts.diffuse[0] / white - 0.7, 2) / kRuns;
  }
  const PredictedError error = predicted_error(straight, contrasts, 2, 0.7, 0, 0);
  EXPECT_LT(std::sqrt(specular), 1.03 * error.specular);
  EXPECT_GT(std::sqrt(specular), 0.7 * error.specular);  // a bound, but no idle one
  EXPECT_LT(std::sqrt(diffuse), 1.03 * error.diffuse);
}

TEST(PredictedError, IsUnboundedWhereNothingCanBeSeparated) {
  Contrasts contrasts;
  contrasts.specular[1] = 0.05;
  EXPECT_EQ(predicted_error({}, contrasts, 1, 1, 0, 0).specular, kInfinity);
}

TEST(GainUncertainty, CoversTheGainsOfIndicesWithinIt) {
  for_each_pair([&](const Geometry& geometry, const FresnelPrediction& prediction) {
    const double uncertainty = gain_uncertainty(prediction, 1.5, 0.1);
    for (double index = 1.4; index < 1.601; index += 0.02) {
      EXPECT_LE(std::abs(predicted(geometry, index).gain - prediction.gain),
                uncertainty + kRounding);
    }
    EXPECT_EQ(gain_uncertainty(prediction, 1.5, 0), 0);
    EXPECT_TRUE(std::isfinite(gain_uncertainty(prediction, 1, 0.5)));
  });
  // At normal incidence all light is alike, and nothing depends on the index.
  EXPECT_NEAR(gain_uncertainty(predicted(geometry_at(0, 0), 1.5), 1.5, 0.1), 0, kRounding);
  EXPECT_GT(gain_uncertainty(predicted(geometry_at(45 * kDegree, 0), 1.5), 1.5, 0.1), 0.01);
}

TEST(Chain, IsTheSameWhenBothPolarisersTurnTogether) {
  // Over what depolarises, at any incidence; over a facet, where light comes back on itself.
  const Rig rig{100, 60, 0.07, 1};
  const Contrasts contrasts = measured(rig);
  const Parts straight =
      separated(pictures_of(0.5 * mirror() + 0.3 * depolariser(), rig), contrasts);
  const Vector3d up(0, 0, 1);
  for (double turn = 0; turn < pi; turn += 0.13) {
    const Vector3d axis(std::cos(turn), std::sin(turn), 0);
    const auto reflection = facet_reflection(up, up, axis, axis, 1.5);
    ASSERT_TRUE(reflection);
    const Parts turned =
        separated(pictures_of(0.5 / 0.04 * *reflection + 0.3 * depolariser(), rig), contrasts);
    EXPECT_LT((turned.specular - straight.specular).abs().maxCoeff(), kRounding) << turn;
    EXPECT_LT((turned.diffuse - straight.diffuse).abs().maxCoeff(), kRounding) << turn;

    const Stokes light = depolariser() * polariser(turn, 100) * Stokes(1, 0, 0, 0);
    EXPECT_NEAR((polariser(turn, 60) * light)[0],
                (polariser(0, 60) * depolariser() * polariser(0, 100) * Stokes(1, 0, 0, 0))[0],
                kRounding);
  }
}

}  // namespace
}  // namespace veneer::capture
