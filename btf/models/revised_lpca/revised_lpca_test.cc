// SPDX-License-Identifier: Apache-2.0
#include "btf/models/revised_lpca/revised_lpca.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <iostream>

#include "btf/internal_test_sets.h"
#include "btf/interpolated_set.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::make_set;
using testing::random_direction;
using testing::ring;

// Factors and weights in float16, for values up to 1.
constexpr double kHalfTolerance = 4e-3;
constexpr std::array kPrecisions{"8bit", "float16"};

SampleSetInfo small_info() {
  SampleSetInfo info;
  info.width = 4;
  info.height = 3;
  info.views = ring(6, 1.0);
  info.lights = ring(7, 1.1);
  info.source = "a formula";
  return info;
}

// Smooth, coloured, and of more components than are asked for.
float sample(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const Direction& v = info.views[static_cast<std::size_t>(view)];
  const Direction& l = info.lights[static_cast<std::size_t>(light)];
  const double shine = std::pow((v + l).normalized().z(), 4.0 + texel);
  const double colour = 0.2 + 0.1 * ((texel * 5 + channel * 3) % 7) / 7.0;
  return static_cast<float>((colour + 0.4 * shine + 0.1 * std::sin(3.0 * v.x() + texel)) * l.z());
}

SampleSet formula_set(const fs::path& folder, const SampleSetInfo& info) {
  return make_set(folder, info, [info](int texel, int view, int light, int channel) {
    return sample(info, texel, view, light, channel);
  });
}

Result<std::unique_ptr<Material>> fit(const SampleSet& set,
                                      std::string components,
                                      std::string precision,
                                      int clusters = 2) {
  FitOptions options;
  options.components = std::move(components);
  options.precision = std::move(precision);
  options.clusters = clusters;
  options.angular = 12;
  SilentProgress progress;
  return fit_revised_lpca(set, options, progress);
}

std::vector<float> reconstruction(const Material& material) {
  const auto values = material.views().size() * material.lights().size() * 3;
  const int texels = material.width() * material.height();
  std::vector<float> all(static_cast<std::size_t>(texels) * values);
  for (int texel = 0; texel < texels; ++texel)
    material.reconstruct(texel,
                         std::span(all).subspan(static_cast<std::size_t>(texel) * values, values));
  return all;
}

std::vector<float> samples_of(const SampleSet& set) {
  const auto values = static_cast<std::size_t>(set.info().pair_count()) * 3;
  std::vector<float> all(static_cast<std::size_t>(set.info().texel_count()) * values);
  for (int texel = 0; texel < set.info().texel_count(); ++texel)
    set.rgb(texel,
            Part::kTotal,
            std::span(all).subspan(static_cast<std::size_t>(texel) * values, values));
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

// The sum of a texel's weights' magnitudes: what its Eigen-BRDFs' errors are multiplied with.
double weight_sum(const Material& material, int texel) {
  for (const auto& [spec, bytes] : material.contents().tensors) {
    if (spec.name != "weights") continue;
    const auto count = static_cast<std::size_t>(spec.shape.back());
    double sum = 0.0;
    for (std::size_t j = 0; j < count; ++j) {
      Eigen::half weight;
      std::memcpy(&weight,
                  &bytes[(static_cast<std::size_t>(texel) * count + j) * sizeof(weight)],
                  sizeof(weight));
      sum += std::abs(static_cast<double>(weight));
    }
    return sum;
  }
  return 0.0;
}

TEST(RevisedLpca, GivesBackWhatItMadeItself) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto first = fit(set, "2", "float16");
  ASSERT_TRUE(first) << first.error().what;
  const std::vector<float> made = reconstruction(**first);
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
  EXPECT_LT(largest_difference(made, reconstruction(**second)), kHalfTolerance);
}

TEST(RevisedLpca, MoreComponentsAreNeverWorse) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  for (const char* precision : kPrecisions) {
    double before = 1.0;
    for (const char* components : {"1", "2", "3", "5"}) {
      const auto material = fit(set, components, precision, 1);
      ASSERT_TRUE(material) << material.error().what;
      const double error = rmse(samples_of(set), reconstruction(**material));
      // Once eight bits limit it, a component that adds nothing may add its rounding.
      EXPECT_LT(error, before + 1e-4) << precision << " " << components;
      before = error;
    }
    EXPECT_LT(before, 1e-2) << precision;
  }
}

// Each Eigen-BRDF is at most 1 and rounded to steps of 1/127: off by at most half a step.
TEST(RevisedLpca, EightBitsDifferFromSixteenByNoMoreThanTheirRounding) {
  constexpr double kHalfStep = 0.5 / 127.0;
  // Weights of the volume round to float16 once more; so do nodes of the float16 volume.
  constexpr double kFloat16 = 2.0 / 2048.0;
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto coarse = fit(set, "3", "8bit");
  const auto fine = fit(set, "3", "float16");
  ASSERT_TRUE(coarse && fine);
  const std::vector<float> a = reconstruction(**coarse);
  const std::vector<float> b = reconstruction(**fine);
  const std::size_t values = a.size() / static_cast<std::size_t>(set.info().texel_count());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(a[i] - b[i]);
    EXPECT_LE(difference, kHalfStep * weight_sum(**fine, static_cast<int>(i / values)) + 1e-6);
    largest = std::max(largest, difference);
  }
  EXPECT_GT(largest, 1e-4) << "nothing was rounded";
  // Nodes are a least-squares fit and may pass 1, by less than this.
  constexpr double kOvershoot = 1.5;
  Pcg32 random(1);
  for (int i = 0; i < 5000; ++i) {
    const int texel = i % set.info().texel_count();
    const Direction view = random_direction(random);
    const Direction light = random_direction(random);
    EXPECT_LE(((*coarse)->radiance(texel, view, light) - (*fine)->radiance(texel, view, light))
                  .cwiseAbs()
                  .maxCoeff(),
              (kHalfStep + kFloat16) * kOvershoot * weight_sum(**fine, texel));
  }
}

TEST(RevisedLpca, NodesOnTheLightsHorizonAreZeroInBothPrecisions) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  for (const char* precision : kPrecisions) {
    const auto material = fit(set, "3", precision);
    ASSERT_TRUE(material) << material.error().what;
    const ModelShader shader = (*material)->shader();
    const ModelTexture& volume = shader.textures.back();
    const auto nodes = static_cast<int>(std::lround(std::sqrt(volume.depth)));
    const std::size_t slice = volume.data.size() / static_cast<std::size_t>(volume.depth);
    int inside = 0;
    for (int z = 0; z < volume.depth; ++z) {
      const int row = z / nodes;
      const int column = z % nodes;
      const bool border = row == 0 || column == 0 || row == nodes - 1 || column == nodes - 1;
      const auto values =
          std::span(volume.data).subspan(static_cast<std::size_t>(z) * slice, slice);
      const bool zero = std::ranges::all_of(values, [](std::byte b) {
        return b == std::byte{0} || b == std::byte{0x80};  // or the float's -0
      });
      if (border) {
        EXPECT_TRUE(zero) << precision << " slice " << z;
      }
      inside += zero ? 0 : 1;
    }
    EXPECT_GT(inside, 0);
  }
}

TEST(RevisedLpca, DrawsTwoFetchesAComponentAndHalfTheBytesInEightBits) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto coarse = fit(set, "4", "");
  const auto fine = fit(set, "4", "float16");
  ASSERT_TRUE(coarse && fine);
  EXPECT_EQ((*coarse)->shader().fetches, 1 + 2 * 4);
  EXPECT_EQ(2 * (*coarse)->shader().textures.back().data.size(),
            (*fine)->shader().textures.back().data.size());
  EXPECT_EQ((*coarse)->contents().metadata.at("precision"), "8bit");
  // Eight weights and the cluster no longer fit into one word.
  const auto eight = fit(set, "8", "");
  ASSERT_TRUE(eight);
  EXPECT_EQ((*eight)->shader().fetches, 2 + 2 * 8);
}

// Meseth et al. 2003, Table 2: 85.9 values a texel for 256 x 256 texels, 81 x 81 directions, 32
// clusters of 8 components; here with the pairs and texels of a set that is quickly made.
TEST(RevisedLpca, CountsWeightsClusterAndShareOfTheFactors) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto material = fit(set, "3", "");
  ASSERT_TRUE(material);
  const double pairs = set.info().pair_count();
  EXPECT_DOUBLE_EQ((*material)->values_per_texel(), 3 + 1 + 2 * 3 * pairs * 3 / 12.0);
}

// For the test below, which runs this one in processes of its own: the number of threads is settled
// when it is first asked for.
TEST(RevisedLpca, DISABLED_PrintsItsVolume) {
  const TemporaryFolder folder;
  const auto material = fit(formula_set(folder.path() / "a.btfset", small_info()), "3", "");
  ASSERT_TRUE(material);
  const ModelShader shader = (*material)->shader();
  std::uint64_t hash = 0;
  for (const std::byte value : shader.textures.back().data)
    hash = hash * 1099511628211U + static_cast<std::uint64_t>(value);
  std::cout << "result " << hash << std::endl;
}

TEST(RevisedLpca, DoesNotDependOnThreads) {
  EXPECT_EQ(testing::results_on_threads("RevisedLpca.DISABLED_PrintsItsVolume", {1, 3}).size(), 1U);
}

TEST(RevisedLpca, OneViewOneLightAndBlackTexelsAreLegal) {
  const TemporaryFolder folder;
  for (const char* precision : kPrecisions) {
    SampleSetInfo info = small_info();
    info.views = {Direction(0.6, 0.0, 0.8)};
    info.lights = {Direction::UnitZ()};
    const SampleSet one = formula_set(folder.path() / "one.btfset", info);
    const auto material = fit(one, "1", precision, 12);  // a cluster for each texel
    ASSERT_TRUE(material) << material.error().what;
    EXPECT_LT(largest_difference(samples_of(one), reconstruction(**material)), kHalfTolerance);
    EXPECT_GT((*material)->radiance(2, Direction::UnitX(), Direction::UnitZ()).minCoeff(), 0.0);
    const SampleSet black = make_set(
        folder.path() / "black.btfset", small_info(), [](int, int, int, int) { return 0.0F; });
    const auto dark = fit(black, "2", precision);
    ASSERT_TRUE(dark) << dark.error().what;
    EXPECT_EQ((*dark)->radiance(0, Direction::UnitZ(), Direction::UnitZ()),
              Eigen::Vector3d::Zero());
  }
}

TEST(RevisedLpca, RefusesPrecisionsAndVolumesThatItCannotDo) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto unknown = fit(set, "2", "16bit");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kInvalidOption);
  EXPECT_NE(unknown.error().what.find("float16"), std::string::npos) << unknown.error().what;
  FitOptions options;
  options.components = "16";
  options.clusters = 12;  // there are no more texels
  options.angular = FitOptions::kMostAngular;
  options.precision = "float16";
  SilentProgress progress;
  // 32^4 nodes of 8 bytes: 8 MiB for each of 16 x 12 Eigen-BRDFs fit, a larger set's 64 would not.
  SampleSetInfo wide = small_info();
  wide.width = 8;
  wide.height = 8;
  const SampleSet larger = formula_set(folder.path() / "b.btfset", wide);
  options.clusters = 64;
  const auto refused = fit_revised_lpca(larger, options, progress);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  EXPECT_NE(refused.error().what.find("angular"), std::string::npos) << refused.error().what;
}

TEST(RevisedLpca, RefusesAFileOfAnUnknownPrecision) {
  const TemporaryFolder folder;
  const SampleSet set = formula_set(folder.path() / "a.btfset", small_info());
  const auto material = fit(set, "2", "");
  ASSERT_TRUE(material);
  for (const char* precision : {"", "7bit"}) {
    Material::Contents contents = (*material)->contents();
    contents.metadata["precision"] = precision;
    std::vector<TensorSpec> specs;
    for (const auto& tensor : contents.tensors) specs.push_back(tensor.spec);
    const fs::path path = folder.path() / "a.safetensors";
    auto writer = SafetensorsWriter::create(path, specs, contents.metadata);
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->finish());
    const auto file = SafetensorsFile::open(path);
    ASSERT_TRUE(file) << file.error().what;
    const auto loaded = load_revised_lpca(*file);
    ASSERT_FALSE(loaded) << precision;
    EXPECT_EQ(loaded.error().code, Errc::kBadFormat) << loaded.error().what;
  }
}

}  // namespace
}  // namespace veneer::btf
