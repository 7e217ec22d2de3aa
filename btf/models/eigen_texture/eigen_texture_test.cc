// SPDX-License-Identifier: Apache-2.0
#include "btf/models/eigen_texture/eigen_texture.h"

#include <Eigen/SVD>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <iostream>

#include "btf/internal_test_sets.h"
#include "btf/interpolated_set.h"
#include "btf/models/eigen_texture/eigen_images.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::make_set;
using testing::random_direction;
using testing::ring;

// Images and weights in float16, for values up to 1.
constexpr double kHalfTolerance = 2e-3;
constexpr std::array kPrecisions{"8bit", "float16"};

SampleSetInfo small_info() {
  SampleSetInfo info;
  info.width = 5;
  info.height = 3;
  info.views = ring(5, 1.0);
  info.lights = ring(7, 1.1);
  info.source = "a formula";
  return info;
}

// Smooth, coloured, and of full rank.
float sample(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const Direction& v = info.views[static_cast<std::size_t>(view)];
  const Direction& l = info.lights[static_cast<std::size_t>(light)];
  const double shine = std::pow((v + l).normalized().z(), 4.0 + texel);
  const double colour = 0.2 + 0.1 * ((texel * 5 + channel * 3) % 7) / 7.0;
  return static_cast<float>((colour + 0.4 * shine + 0.1 * std::sin(3.0 * l.x() + texel)) * l.z());
}

SampleSet formula_set(const fs::path& folder, const SampleSetInfo& info) {
  return make_set(folder, info, [info](int texel, int view, int light, int channel) {
    return sample(info, texel, view, light, channel);
  });
}

Result<std::unique_ptr<Material>> fit(const SampleSet& set,
                                      std::string components,
                                      std::string precision) {
  FitOptions options;
  options.components = std::move(components);
  options.precision = std::move(precision);
  SilentProgress progress;
  return fit_eigen_texture(set, options, progress);
}

// All texels' values, [texel][view][light][3], of a set or a material.
std::vector<float> values_of(const SampleSet& set) {
  const auto count = static_cast<std::size_t>(set.info().pair_count()) * 3;
  std::vector<float> all(static_cast<std::size_t>(set.info().texel_count()) * count);
  for (int texel = 0; texel < set.info().texel_count(); ++texel)
    set.rgb(texel,
            Part::kTotal,
            std::span(all).subspan(static_cast<std::size_t>(texel) * count, count));
  return all;
}
std::vector<float> values_of(const Material& material) {
  const auto count = material.views().size() * material.lights().size() * 3;
  const int texels = material.width() * material.height();
  std::vector<float> all(static_cast<std::size_t>(texels) * count);
  for (int texel = 0; texel < texels; ++texel)
    material.reconstruct(texel,
                         std::span(all).subspan(static_cast<std::size_t>(texel) * count, count));
  return all;
}

double rmse(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::pow(a[i] - b[i], 2.0);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, double(std::abs(a[i] - b[i])));
  return largest;
}

TEST(EigenTexture, AsManyComponentsAsLightsAreExact) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto material = fit(set, "8", "float16");
  ASSERT_TRUE(material) << material.error().what;
  EXPECT_LT(largest_difference(values_of(set), values_of(**material)), kHalfTolerance);
}

TEST(EigenTexture, GivesBackWhatItMadeItself) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto first = fit(set, "2", "float16");
  ASSERT_TRUE(first) << first.error().what;
  const std::vector<float> made = values_of(**first);
  const SampleSetInfo& info = set.info();
  const SampleSet own =
      make_set(folder.path() / "b.btfset", info, [&](int texel, int view, int light, int channel) {
        const auto pair =
            static_cast<std::size_t>((texel * static_cast<int>(info.views.size()) + view) *
                                         static_cast<int>(info.lights.size()) +
                                     light);
        return made[3 * pair + static_cast<std::size_t>(channel)];
      });
  const auto second = fit(own, "2", "float16");
  ASSERT_TRUE(second) << second.error().what;
  EXPECT_LT(largest_difference(made, values_of(**second)), kHalfTolerance);
}

// The error of a view is the energy of the eigenvectors left out (Eckart and Young 1936): no other
// fit of that rank is better, and each component takes its part.
TEST(EigenTexture, LeavesTheEnergyOfTheComponentsLeftOut) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const std::vector<float> wanted = values_of(set);
  const auto lights = static_cast<Eigen::Index>(set.info().lights.size());
  const auto views = static_cast<Eigen::Index>(set.info().views.size());
  const int texels = set.info().texel_count();
  for (const int components : {1, 2, 4}) {
    double left = 0.0;
    for (Eigen::Index view = 0; view < views; ++view) {
      Eigen::MatrixXd pictures(lights, 3 * texels);
      for (int texel = 0; texel < texels; ++texel)
        pictures.middleCols(3 * texel, 3) =
            Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>(
                &wanted[static_cast<std::size_t>((texel * views + view) * lights * 3)], lights, 3)
                .cast<double>();
      const Eigen::VectorXd squares =
          pictures.jacobiSvd().singularValues().array().square().matrix();
      left += squares.tail(squares.size() - components).sum();
    }
    const auto material = fit(set, std::to_string(components), "float16");
    ASSERT_TRUE(material) << material.error().what;
    EXPECT_NEAR(rmse(wanted, values_of(**material)),
                std::sqrt(left / static_cast<double>(wanted.size())),
                2e-4);  // rounding to float16
  }
}

TEST(EigenTexture, MoreComponentsAreNeverWorse) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  for (const char* precision : kPrecisions) {
    double before = 1.0;
    for (const char* components : {"1", "2", "3", "5", "16"}) {
      const auto material = fit(set, components, precision);
      ASSERT_TRUE(material) << material.error().what;
      const double error = rmse(values_of(set), values_of(**material));
      // Once eight bits limit it, a component that adds nothing may add its rounding.
      EXPECT_LT(error, before + 2e-4) << precision << " " << components;
      before = error;
    }
  }
}

// A value's rounding is at most half a step of each image, times its weight: with values stored as
// parts of 1, sum |weight| / 510. Weights are the same in both but for their scale, so the bound is
// taken from the 8-bit ones.
TEST(EigenTexture, EightBitsDifferFromSixteenByNoMoreThanTheirRounding) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  SilentProgress progress;
  constexpr int kComponents = 4;
  const auto pairs = FittedPairs::of(set.info(), nullptr);
  ASSERT_TRUE(pairs) << pairs.error().what;
  const EigenImages coarse = fit_eigen_images(set, *pairs, kComponents, Precision::k8Bit, progress);
  const EigenImages fine =
      fit_eigen_images(set, *pairs, kComponents, Precision::kFloat16, progress);
  const std::size_t lights = set.info().lights.size();
  const auto texels = static_cast<std::size_t>(set.info().texel_count());
  double largest = 0.0;
  for (std::size_t view = 0; view < set.info().views.size(); ++view)
    for (std::size_t texel = 0; texel < texels; ++texel)
      for (std::size_t light = 0; light < lights; ++light) {
        Eigen::Vector3d difference = Eigen::Vector3d::Zero();
        double bound = 2e-3;  // float16, of images and weights
        for (int i = 0; i < kComponents; ++i) {
          const auto at = (view * lights + light) * kComponents + static_cast<std::size_t>(i);
          const auto a = static_cast<double>(coarse.weights[at]);
          const auto b = static_cast<double>(fine.weights[at]);
          difference +=
              a * coarse.image(view * texels + texel, i) - b * fine.image(view * texels + texel, i);
          bound += std::abs(a) / 510.0;
        }
        EXPECT_LE(difference.cwiseAbs().maxCoeff(), bound);
        largest = std::max(largest, difference.cwiseAbs().maxCoeff());
      }
  EXPECT_GT(largest, 1e-4) << "nothing was rounded";
  // Pictures of light have no negative values, and so has the first image.
  EXPECT_EQ(coarse.zeros.front(), 0);
}

TEST(EigenTexture, BlackTexelsStayBlackInBothPrecisions) {
  const TemporaryFolder folder;
  const SampleSetInfo info = small_info();
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        return texel == 4 ? 0.0F : sample(info, texel, view, light, channel);
      });
  Pcg32 random(1);
  for (const char* precision : kPrecisions) {
    const auto material = fit(set, "5", precision);
    ASSERT_TRUE(material) << material.error().what;
    for (int i = 0; i < 100; ++i)
      EXPECT_EQ((*material)->radiance(4, random_direction(random), random_direction(random)),
                Eigen::Vector3d::Zero());
  }
}

// At full rank only the mixing of directions is left, which is the reference's own but in cells
// that an edge of its triangles crosses.
TEST(EigenTexture, IsDrawnAsTheInterpolatedSet) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const InterpolatedSet reference(set);
  const auto material = fit(set, "8", "float16");
  ASSERT_TRUE(material);
  Pcg32 random(2);
  double mean = 0.0;
  constexpr int kSamples = 2000;
  for (int i = 0; i < kSamples; ++i) {
    const Direction view = random_direction(random);
    const Direction light = random_direction(random, 1e-3);
    mean += ((*material)->radiance(i % 15, view, light) - reference.radiance(i % 15, view, light))
                .cwiseAbs()
                .maxCoeff() /
            kSamples;
  }
  EXPECT_LT(mean, 2e-3);
}

TEST(EigenTexture, OneViewAndOneLightAreLegal) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info();
  info.views = {Direction(0.6, 0.0, 0.8)};
  info.lights = {Direction::UnitZ()};
  const SampleSet set = formula_set(folder.path() / "a.btfset", info);
  for (const char* precision : kPrecisions) {
    const auto material = fit(set, "4", precision);  // three of them more than lights
    ASSERT_TRUE(material) << material.error().what;
    EXPECT_LT(largest_difference(values_of(set), values_of(**material)), 2 * kHalfTolerance);
  }
}

// Meseth et al. 2003, Table 2: 3888 values a texel for 81 views and 16 components, a byte each.
TEST(EigenTexture, KeepsThreeValuesForEachViewAndComponent) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto material = fit(set, "4", "");
  ASSERT_TRUE(material);
  EXPECT_EQ((*material)->values_per_texel(), 6 * 4 * 3);
  const ModelShader shader = (*material)->shader();
  EXPECT_EQ(shader.textures[1].data.size(), 15U * 6 * 4 * 3) << "a byte each";
  EXPECT_EQ(shader.fetches, 2 * 5 + 9 * 1 + 3 * 3);
}

TEST(EigenTexture, RefusesMoreLayersThanGpusTakeAndSaysWhatToLower) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info();
  info.width = info.height = 1;
  info.views = ring(180, 1.0);
  info.lights = {Direction::UnitZ()};
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [](int, int, int, int) { return 0.5F; });
  const auto refused = fit(set, "16", "");  // 181 x 12 layers
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  EXPECT_NE(refused.error().what.find("fewer components"), std::string::npos)
      << refused.error().what;
  EXPECT_TRUE(fit(set, "14", ""));  // 181 x 11
}

// For the test below, which runs this one in processes of its own: the number of threads is settled
// when it is first asked for.
TEST(EigenTexture, DISABLED_PrintsItsImages) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info();
  info.width = 40;  // several blocks
  info.height = 15;
  const auto material = fit(formula_set(folder.path() / "a.btfset", info), "3", "");
  ASSERT_TRUE(material);
  std::uint64_t hash = 0;
  for (const ModelTexture& texture : (*material)->shader().textures)
    for (const std::byte value : texture.data)
      hash = hash * 1099511628211U + static_cast<std::uint64_t>(value);
  std::cout << "result " << hash << std::endl;
}

TEST(EigenTexture, DoesNotDependOnThreads) {
  EXPECT_EQ(testing::results_on_threads("EigenTexture.DISABLED_PrintsItsImages", {1, 3}).size(),
            1U);
}

}  // namespace
}  // namespace veneer::btf
