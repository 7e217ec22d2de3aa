// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lobes/lobe_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "btf/internal_test_sets.h"
#include "btf/models/lobes/lafortune_lobes.h"

namespace veneer::btf {
namespace {

using testing::random_direction;

// The part of the targets' squares that may be left of data made by lobes: coefficients rounded to
// float16 (2^-12) times exponents up to 29 move a lobe by 1 % at most, its square by 1e-4.
constexpr double kRecovered = 1e-4;
// Added lobes are refined to kLeastGain only, so that one may stop a little short of one fewer.
constexpr double kMonotone = 1.01;

const std::vector<LobeShape> kStarts{
    {{-1.0F, -1.0F, 1.0F}, 10.0F}, {{1.0F, 1.0F, 1.0F}, 5.0F}, {{0.0F, 0.0F, 1.0F}, 2.0F}};

MaterialFrame bonn_frame() {
  DirectionSet directions = bonn_directions();
  std::erase_if(directions, [](const Direction& d) { return d.z() < 0.4; });
  return {1, 1, directions, directions};
}

LobeTargets unweighted(const LobeSamples& samples) {
  return {Eigen::ArrayXf::Ones(samples.u.rows()), Eigen::MatrixX3f::Zero(samples.u.rows(), 3)};
}

// The largest exponent of a lobe of LobeSpace::kPair that the fitter may find: beyond it, a lobe
// rises to more than four times what it has at any sample, where nothing was measured.
double largest_exponent(const LobeSamples& samples, const Eigen::Vector3f& c) {
  const float anywhere = std::max(c.head<2>().cwiseAbs().maxCoeff(), c.z());
  const float measured = (samples.u.matrix() * c).maxCoeff();
  return std::log(4.0) / std::log(static_cast<double>(anywhere / measured));
}

// A lobe about the mirror direction or back to the light, off by a little, as steep as it likes to
// be within the fitter's bound.
std::array<Eigen::half, kLobeValues> random_lobe(Pcg32& random,
                                                 const LobeSamples& samples,
                                                 bool mirrored) {
  const auto about = [&](double x) {
    return static_cast<float>(x * (0.85 + 0.3 * random.uniform()));
  };
  const float side = mirrored ? -1.0F : 1.0F;
  const float x = about(side);
  const float y = about(side);
  const Eigen::Vector3f c(x, y, about(1.0));
  constexpr double kWithin = 0.98;  // c in float16 moves the bound
  const double exponent = std::min(static_cast<double>(about(mirrored ? 25.0 : 4.0)),
                                   kWithin * largest_exponent(samples, c));
  return {Eigen::half(c.x()),
          Eigen::half(c.y()),
          Eigen::half(c.z()),
          Eigen::half(static_cast<float>(exponent))};
}

double sum_of_squares(const LobeTargets& targets) {
  return targets.rgb.cast<double>().squaredNorm();
}

TEST(LobeValue, IsZeroWhereTheBaseIsNotPositive) {
  const std::array<Eigen::half, 4> lobe{
      Eigen::half(-1.0F), Eigen::half(-1.0F), Eigen::half(1.0F), Eigen::half(3.5F)};
  EXPECT_EQ(lobe_value(lobe, {1.0, 0.0, 0.5}), 0.0);
  EXPECT_EQ(lobe_value(lobe, {0.5, 0.0, 0.5}), 0.0);
  EXPECT_EQ(lobe_value(lobe, Eigen::Vector3d::Zero()), 0.0);
  EXPECT_NEAR(lobe_value(lobe, {-0.25, -0.25, 0.5}), 1.0, 1e-12);
  EXPECT_NEAR(lobe_value(lobe, {0.0, 0.0, 0.5}), std::pow(0.5, 3.5), 1e-12);
}

TEST(LobeFitter, RecoversLobesThatMadeTheSamples) {
  const LobeSamples samples = pair_samples(bonn_frame());
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const int lobes = 1 + static_cast<int>(seed % 2);
    Pcg32 random(seed, 7);
    std::vector<std::array<Eigen::half, kLobeValues>> truth;
    for (int i = 0; i < lobes; ++i) truth.push_back(random_lobe(random, samples, i == 0));
    const Eigen::RowVector3f diffuse(0.1F, 0.3F, static_cast<float>(random.uniform()));
    const Eigen::RowVector3f specular(0.5F, 0.4F, static_cast<float>(random.uniform()));
    LobeTargets targets = unweighted(samples);
    for (Eigen::Index row = 0; row < samples.u.rows(); ++row) {
      double sum = 0.0;
      for (const auto& lobe : truth)
        sum += lobe_value(lobe, samples.u.row(row).matrix().transpose().cast<double>());
      targets.rgb.row(row) = samples.cosine[row] * (diffuse + static_cast<float>(sum) * specular);
    }
    const LobeFitter fitter(samples, lobes);
    const StoredLobes stored = fitter.store(targets, Diffuse::kFree, fitter.fit(targets, kStarts));
    EXPECT_LT(stored.squared_error, kRecovered * sum_of_squares(targets)) << "seed " << seed;
  }
}

TEST(LobeFitter, ErrorFallsAsLobesGrow) {
  const LobeSamples samples = pair_samples(bonn_frame());
  Pcg32 random(11);
  LobeTargets targets = unweighted(samples);
  // A highlight that is no lobe, and noise.
  for (Eigen::Index row = 0; row < samples.u.rows(); ++row) {
    const Eigen::RowVector3f u = samples.u.row(row).matrix();
    const float highlight = 1.0F / (0.05F + (u - Eigen::RowVector3f(-0.3F, -0.2F, 0.6F)).norm());
    for (int c = 0; c < 3; ++c)
      targets.rgb(row, c) =
          samples.cosine[row] * (0.1F * highlight + 0.05F * static_cast<float>(random.uniform()));
  }
  double before = std::numeric_limits<double>::infinity();
  for (int lobes = 1; lobes <= FitOptions::kMostLobes; ++lobes) {
    const LobeFitter fitter(samples, lobes);
    const double error =
        fitter.store(targets, Diffuse::kFree, fitter.fit(targets, kStarts)).squared_error;
    EXPECT_LE(error, kMonotone * before) << lobes;
    before = error;
  }
  EXPECT_LT(before, 0.1 * sum_of_squares(targets));
}

TEST(LobeFitter, LobesRiseLittleBeyondWhatWasMeasured) {
  // Few samples and no law in them: what makes exponents run away.
  MaterialFrame frame = bonn_frame();
  frame.views.resize(5);
  frame.lights.resize(9);
  const LobeSamples samples = pair_samples(frame);
  const LobeFitter fitter(samples, 2);
  constexpr double kMostRise = 4.0 * 1.2;  // and float16
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Pcg32 random(seed, 3);
    LobeTargets targets = unweighted(samples);
    for (Eigen::Index i = 0; i < targets.rgb.size(); ++i)
      targets.rgb(i) = static_cast<float>(std::pow(random.uniform(), 8.0));
    const StoredLobes stored = fitter.store(targets, Diffuse::kFree, fitter.fit(targets, kStarts));
    for (std::size_t lobe = 0; lobe < 2; ++lobe) {
      const auto values = std::span(stored.lobes).subspan(kLobeValues * lobe, kLobeValues);
      double measured = 0.0;
      for (Eigen::Index row = 0; row < samples.u.rows(); ++row)
        measured = std::max(
            measured, lobe_value(values, samples.u.row(row).matrix().transpose().cast<double>()));
      for (int i = 0; i < 2000; ++i) {
        const Direction view = random_direction(random);
        EXPECT_LE(lobe_value(values, view.cwiseProduct(random_direction(random))),
                  kMostRise * measured);
      }
    }
  }
}

TEST(LobeFitter, AnySamplesGiveFiniteNumbersNoWorseThanDiffuse) {
  MaterialFrame one = bonn_frame();
  one.views.resize(1);
  one.lights.resize(1);
  MaterialFrame grazing = one;
  grazing.views = {direction_from_angles({std::numbers::pi / 2, 0.0})};
  grazing.lights = {direction_from_angles({std::numbers::pi / 2, 1.0})};
  for (const MaterialFrame& frame : {bonn_frame(), one, grazing}) {
    const LobeSamples samples = pair_samples(frame);
    const LobeFitter fitter(samples, 4);
    for (const float spike : {0.0F, 1e-7F, 1.0F, 60000.0F}) {
      LobeTargets targets = unweighted(samples);
      targets.rgb.row(samples.u.rows() / 2).setConstant(spike);
      const StoredLobes diffuse = fitter.store(targets, Diffuse::kFree, {});
      const TexelFit fit = fit_texel(fitter, targets);
      EXPECT_TRUE(std::isfinite(fit.stored.squared_error)) << spike;
      EXPECT_LE(fit.stored.squared_error, diffuse.squared_error) << spike;
      ASSERT_EQ(fit.stored.lobes.size(), 4U * kLobeValues);
      for (const Eigen::half value : fit.stored.lobes) EXPECT_TRUE(Eigen::numext::isfinite(value));
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_GE(std::min(fit.stored.diffuse[c], fit.stored.specular[c]), Eigen::half(0.0F));
      if (spike == 0.0F) {
        EXPECT_TRUE(fit.fell_back);
      }
    }
  }
}

}  // namespace
}  // namespace veneer::btf
