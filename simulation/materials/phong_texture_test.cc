// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/phong_texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"
#include "simulation/materials/internal_test_fields.h"

namespace veneer::simulation {
namespace {

namespace fs = std::filesystem;

constexpr double kHalfStep = 4.9e-4;  // half a step of a half, 2^-11, of the value
constexpr int kAcross = 40;           // places looked at along each side

template <class Look>
void for_places(const Look& look) {
  for (int row = 0; row < kAcross; ++row)
    for (int column = 0; column < kAcross; ++column)
      look(static_cast<double>(column) / kAcross, static_cast<double>(row) / kAcross);
}

TEST(PhongPoint, IsReciprocal) {
  const PhongPoint point{{0.7, 0.2, 0.1}, 0.2, 13.0};
  const btf::Direction a = toward(20, 40);
  const btf::Direction b = toward(65, 200);
  // f_r is a sample over pi cos(theta_l).
  EXPECT_NEAR(point.specular_sample(a, b) / b.z(), point.specular_sample(b, a) / a.z(), 1e-12);
  EXPECT_NEAR(point.diffuse_sample(a, b)[0] / b.z(), point.diffuse_sample(b, a)[0] / a.z(), 1e-12);
}

TEST(PhongPoint, SendsNoMoreThanItGets) {
  constexpr int kRings = 200;
  constexpr int kAzimuths = 200;
  for (const double exponent : {0.0, 1.0, 6.0, 40.0}) {
    for (const double theta : {0.0, 30.0, 60.0, 85.0}) {
      const PhongPoint point{Eigen::Vector3d::Constant(0.6), 0.4, exponent};
      const btf::Direction view = toward(theta, 10);
      double sum = 0.0;  // of f_r cos over the hemisphere, in equal steps of cos and azimuth
      for (int i = 0; i < kRings; ++i) {
        for (int k = 0; k < kAzimuths; ++k) {
          const double z = (i + 0.5) / kRings;
          const double phi = 2.0 * std::numbers::pi * k / kAzimuths;
          const double r = std::sqrt(1.0 - z * z);
          const btf::Direction light(r * std::cos(phi), r * std::sin(phi), z);
          sum += point.specular_sample(view, light) + point.diffuse_sample(view, light)[0];
        }
      }
      const double sent = 2.0 * sum / (kRings * kAzimuths);
      EXPECT_LE(sent, 1.01) << exponent << ' ' << theta;  // the sum is good to a percent
      if (theta == 0.0) {
        EXPECT_NEAR(sent, 1.0, 0.01) << exponent;
      }
    }
  }
}

TEST(PhongPoint, IsBlackAtAndBelowTheHorizon) {
  const PhongPoint point{{0.7, 0.2, 0.1}, 0.2, 0.0};
  for (const btf::Direction& low : {btf::Direction(1, 0, 0), toward(120, 0)}) {
    for (const bool is_view : {true, false}) {
      const btf::Direction view = is_view ? low : toward(0, 0);
      const btf::Direction light = is_view ? toward(0, 0) : low;
      EXPECT_EQ(point.specular_sample(view, light), 0.0);
      EXPECT_EQ(point.diffuse_sample(view, light).norm(), 0.0);
    }
  }
}

TEST(PhongTexture, KeepsEnergyEverywhereAndRepeatsWithoutASeam) {
  for_places([](double x, double y) {
    const PhongPoint point = phong_texture(x, y, 3);
    EXPECT_GT(point.diffuse.minCoeff(), 0.0);
    EXPECT_LE(point.diffuse.maxCoeff() + point.strength, 1.0);
    EXPECT_GT(point.strength, 0.0);
    EXPECT_GE(point.exponent, 0.0);
    // 0.5 is exact, so nothing is rounded but the place itself.
    EXPECT_NEAR((phong_texture(x + 1.0, y - 1.0, 3).diffuse - point.diffuse).norm(), 0.0, 1e-9);
  });
}

TEST(PhongTexture, HasAllHuesAndDependsOnTheSeed) {
  int leads[3] = {};  // places where a channel is the largest
  int same = 0;
  for_places([&](double x, double y) {
    const PhongPoint point = phong_texture(x, y, 1);
    int largest = 0;
    point.diffuse.maxCoeff(&largest);
    ++leads[largest];
    if (phong_texture(x, y, 2).diffuse == point.diffuse) ++same;
  });
  for (const int count : leads) EXPECT_GT(count, kAcross * kAcross / 6);
  EXPECT_EQ(same, 0);
}

class PhongSetTest : public testing::Test {
 protected:
  TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

TEST_F(PhongSetTest, HoldsTheFormulaAtEveryTexelAndPair) {
  SynthesisOptions options;
  options.size = 5;
  options.views = {toward(0, 0), toward(50, 80)};
  options.lights = {toward(0, 0), toward(30, 10), toward(75, 250)};
  SilentProgress silent;
  ASSERT_TRUE(synthesize_phong(folder_ / "p.btfset", options, silent).has_value());
  const auto set = btf::SampleSet::open(folder_ / "p.btfset");
  ASSERT_TRUE(set.has_value()) << set.error().what;
  ASSERT_TRUE(set->info().polarised);
  std::vector<float> specular(6 * 3);
  std::vector<float> diffuse(6 * 3);
  for (int texel = 0; texel < 25; ++texel) {
    const PhongPoint point =
        phong_texture((texel % 5 + 0.5) / 5.0, (texel / 5 + 0.5) / 5.0, options.seed);
    set->rgb(texel, btf::Part::kSpecular, specular);
    set->rgb(texel, btf::Part::kDiffuse, diffuse);
    for (std::size_t i = 0; i < 18; ++i) {
      const btf::Direction& view = options.views[i / 9];
      const btf::Direction& light = options.lights[i / 3 % 3];
      const double shine = point.specular_sample(view, light);
      const double body = point.diffuse_sample(view, light)[static_cast<Eigen::Index>(i % 3)];
      // Below 6e-5 halves have equal steps, of 6e-8.
      EXPECT_NEAR(specular[i], shine, kHalfStep * shine + 6e-8) << texel;
      EXPECT_NEAR(diffuse[i], body, kHalfStep * body) << texel;
    }
  }
}

TEST_F(PhongSetTest, RefusesBadOptionsAndLeavesNothingBehind) {
  SynthesisOptions options;
  options.size = 0;
  SilentProgress silent;
  const Status status = synthesize_phong(folder_ / "p.btfset", options, silent);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, Errc::kInvalidOption);
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace veneer::simulation
