// SPDX-License-Identifier: Apache-2.0
#include "btf/mapped_material.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/random.h"
#include "btf/evaluation.h"
#include "btf/models/internal_test_models.h"
#include "btf/models/layered/layered.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::components_of;
using testing::dichromatic;
using testing::dichromatic_set;
using testing::fit;
using testing::make_set;
using testing::options_with;
using testing::random_direction;
using testing::small_info;

constexpr int kWidth = 9;  // of the map; no multiple of the sample's 5 x 3
constexpr int kHeight = 7;

TexelMap random_map(int width, int height, int sample_width, int sample_height) {
  Pcg32 random(11);
  std::vector<TexelMap::Source> sources;
  for (int i = 0; i < width * height; ++i)
    sources.push_back({static_cast<std::uint16_t>(random.uniform() * sample_width),
                       static_cast<std::uint16_t>(random.uniform() * sample_height)});
  auto map = TexelMap::create(width, height, std::move(sources), sample_width, sample_height);
  EXPECT_TRUE(map) << map.error().what;
  return std::move(*map);
}

// Every texel in its own place.
TexelMap plain_map(int repeats, int sample_width, int sample_height) {
  std::vector<TexelMap::Source> sources;
  for (int y = 0; y < repeats * sample_height; ++y)
    for (int x = 0; x < repeats * sample_width; ++x)
      sources.push_back({static_cast<std::uint16_t>(x % sample_width),
                         static_cast<std::uint16_t>(y % sample_height)});
  auto map = TexelMap::create(repeats * sample_width,
                              repeats * sample_height,
                              std::move(sources),
                              sample_width,
                              sample_height);
  EXPECT_TRUE(map) << map.error().what;
  return std::move(*map);
}

// Three layers, as full of differences as a stack may be.
std::unique_ptr<Material> random_layers(const SampleSetInfo& info) {
  LayerStack stack(info.width, info.height, {2.5F, 0.5F, -1.5F});
  Pcg32 random(3);
  const auto colour = [&] {
    return Eigen::Vector3f(
        Eigen::Vector3d(random.uniform(), random.uniform(), random.uniform()).cast<float>());
  };
  for (int layer = 0; layer < stack.layer_count(); ++layer)
    for (int texel = 0; texel < stack.texel_count(); ++texel) {
      LayerPoint point;
      point.diffuse = colour();
      point.transmittance = static_cast<float>(random.uniform());
      point.specular = colour();
      point.exponent = static_cast<float>(1 + 10 * random.uniform());
      point.diffuse_radiance = static_cast<float>(0.3 * random.uniform());
      stack.set_point(layer, texel, point);
    }
  return layered_material(frame_of(info), std::move(stack));
}

TEST(MappedMaterial, ShowsInEveryPlaceTheTexelThatItsMapNames) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const auto pairs = static_cast<std::size_t>(set.info().pair_count());
  for (const Model& model : models()) {
    if (model.name == "layered") continue;  // looks at neighbours, in the next test
    SCOPED_TRACE(model.name);
    const FitOptions options = options_with(components_of(model, "2", "1+1"));
    auto sample = fit(model.name, set, options);
    auto again = fit(model.name, set, options);
    ASSERT_TRUE(sample && again);
    const TexelMap map = random_map(kWidth, kHeight, set.info().width, set.info().height);
    const auto mapped = with_texel_map(std::move(*again), map);
    ASSERT_TRUE(mapped) << mapped.error().what;
    EXPECT_EQ((*mapped)->model(), model.name);
    EXPECT_EQ((*mapped)->width(), kWidth);
    EXPECT_EQ((*mapped)->height(), kHeight);
    EXPECT_EQ((*mapped)->values_per_texel(), (*sample)->values_per_texel());
    Pcg32 random(5);
    std::vector<float> wanted(3 * pairs);
    std::vector<float> got(3 * pairs);
    for (int place = 0; place < map.place_count(); ++place) {
      const int source = map.source_texel(place);
      const Direction view = random_direction(random);
      const Direction light = random_direction(random);
      ASSERT_EQ((*mapped)->radiance(place, view, light), (*sample)->radiance(source, view, light));
      ASSERT_EQ((*mapped)->diffuse_radiance(place, view, light),
                (*sample)->diffuse_radiance(source, view, light));
      (*sample)->reconstruct(source, wanted);
      (*mapped)->reconstruct(place, got);
      ASSERT_EQ(got, wanted);
    }
    // One fetch and four bytes a place more; the model's own textures stay.
    const ModelShader plain = (*sample)->shader();
    const ModelShader larger = (*mapped)->shader();
    EXPECT_EQ(larger.fetches, plain.fetches + 1);
    EXPECT_EQ(larger.gpu_bytes(), plain.gpu_bytes() + std::size_t{4} * kWidth * kHeight);
  }
}

// Parallax moves on the map: by plain repeats, what is seen is what the sample's own repeats show;
// by a map that turns the tile by some columns and rows, the turned picture.
TEST(MappedMaterial, OfLayersMovesOverTheMapBeforeItLooksAtTheSample) {
  const SampleSetInfo info = small_info();
  const auto sample = random_layers(info);
  const auto repeated = with_texel_map(random_layers(info), plain_map(3, info.width, info.height));
  ASSERT_TRUE(repeated) << repeated.error().what;
  const int columns = (*repeated)->width();
  const auto turned_sources = [&] {
    std::vector<TexelMap::Source> sources;
    for (int y = 0; y < info.height; ++y)
      for (int x = 0; x < info.width; ++x)
        sources.push_back({static_cast<std::uint16_t>((x + 2) % info.width),
                           static_cast<std::uint16_t>((y + 1) % info.height)});
    return sources;
  };
  auto turned_map =
      TexelMap::create(info.width, info.height, turned_sources(), info.width, info.height);
  ASSERT_TRUE(turned_map);
  const auto turned = with_texel_map(random_layers(info), *turned_map);
  const auto mixed =
      with_texel_map(random_layers(info), random_map(kWidth, kHeight, info.width, info.height));
  ASSERT_TRUE(turned && mixed);
  Pcg32 random(6);
  int moved = 0;
  for (int i = 0; i < 500; ++i) {
    const Direction view = random_direction(random);
    const Direction light = random_direction(random);
    const int x = static_cast<int>(random.uniform() * columns);
    const int y = static_cast<int>(random.uniform() * (*repeated)->height());
    const int texel = y % info.height * info.width + x % info.width;
    ASSERT_EQ((*repeated)->radiance(y * columns + x, view, light),
              sample->radiance(texel, view, light));
    ASSERT_EQ((*turned)->radiance(texel, view, light),
              sample->radiance(turned_map->source_texel(texel), view, light));
    // Where pieces of the sample meet, a slanted ray sees another piece.
    const int place = i % (kWidth * kHeight);
    const int source = (*mixed)->texel_map()->source_texel(place);
    const double difference =
        ((*mixed)->radiance(place, view, light) - sample->radiance(source, view, light)).norm();
    if (difference > 1e-3) ++moved;
  }
  EXPECT_GT(moved, 250);
  std::vector<float> pairs(static_cast<std::size_t>(info.pair_count()) * 3);
  (*mixed)->reconstruct(4, pairs);
  const Eigen::Vector3d first = (*mixed)->radiance(4, info.views[0], info.lights[0]);
  EXPECT_EQ(pairs[0], static_cast<float>(first[0]));
}

TEST(MappedMaterial, IsReadBackFromItsFileWithItsScale) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info(true);
  info.scale = 3.0;
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        return dichromatic(info, texel, view, light, channel);
      });
  for (const Model& model : models()) {
    SCOPED_TRACE(model.name);
    auto sample = fit(model.name, set, options_with(components_of(model, "2", "1+1")));
    ASSERT_TRUE(sample) << sample.error().what;
    const auto mapped =
        with_texel_map(std::move(*sample), random_map(kWidth, kHeight, info.width, info.height));
    ASSERT_TRUE(mapped) << mapped.error().what;
    const fs::path path = folder.path() / "a.safetensors";
    ASSERT_TRUE(save_material(**mapped, path, {}));
    const auto loaded = load_material(path);
    ASSERT_TRUE(loaded) << loaded.error().what;
    ASSERT_NE((*loaded)->texel_map(), nullptr);
    EXPECT_EQ((*loaded)->texel_map()->sources(), (*mapped)->texel_map()->sources());
    EXPECT_EQ((*loaded)->width(), kWidth);
    EXPECT_EQ((*loaded)->shader().source, (*mapped)->shader().source);
    Pcg32 random(7);
    for (int place = 0; place < kWidth * kHeight; ++place) {
      const Direction view = random_direction(random);
      const Direction light = random_direction(random);
      ASSERT_EQ((*loaded)->radiance(place, view, light), (*mapped)->radiance(place, view, light));
    }
  }
}

// Of a good file of phong with one tensor changed.
TEST(MappedMaterial, OfADamagedFileIsRefused) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const fs::path path = folder.path() / "a.safetensors";
  const auto sample = fit("phong", set, {});
  ASSERT_TRUE(sample) << sample.error().what;
  const auto load_with = [&](std::vector<std::int64_t> shape, std::vector<std::uint16_t> values) {
    // A material that says what the file is to hold.
    class Damaged final : public Material {
     public:
      Damaged(const Material& stored, Contents::Tensor tensor)
          : stored_(stored), tensor_(std::move(tensor)) {}
      std::string_view model() const override { return stored_.model(); }
      int width() const override { return stored_.width(); }
      int height() const override { return stored_.height(); }
      const DirectionSet& views() const override { return stored_.views(); }
      const DirectionSet& lights() const override { return stored_.lights(); }
      void reconstruct(int /*texel*/, std::span<float> /*rgb*/) const override {}
      Eigen::Vector3d radiance(int texel, const Direction& v, const Direction& l) const override {
        return stored_.radiance(texel, v, l);
      }
      ModelShader shader() const override { return stored_.shader(); }
      double values_per_texel() const override { return 0.0; }
      Contents contents() const override {
        Contents contents = stored_.contents();
        contents.tensors.push_back(tensor_);
        return contents;
      }

     private:
      const Material& stored_;
      Contents::Tensor tensor_;
    };
    const Damaged damaged(**sample, tensor_of("texel_map", std::move(shape), values));
    EXPECT_TRUE(save_material(damaged, path, {}));
    return load_material(path);
  };
  const auto width = static_cast<std::uint16_t>(set.info().width);
  const auto height = static_cast<std::uint16_t>(set.info().height);
  const auto last_column = static_cast<std::uint16_t>(width - 1);
  const auto last_row = static_cast<std::uint16_t>(height - 1);
  EXPECT_TRUE(load_with({1, 2, 2}, {0, 0, last_column, last_row}));
  const std::vector<std::pair<std::string, std::function<Result<std::unique_ptr<Material>>()>>>
      refusals{
          {"texel (5, 0) of a sample of 5 x 3",
           [&] {
             return load_with({1, 2, 2}, {0, 0, width, 0});
           }},
          {"texel (0, 3) of a sample of 5 x 3",
           [&] {
             return load_with({1, 2, 2}, {0, height, 0, 0});
           }},
          {"texel (65535, 65535)",
           [&] {
             return load_with({1, 1, 2}, {0xFFFF, 0xFFFF});
           }},
          {"16385",
           [&] {
             return load_with({1, TexelMap::kMostSide + 1, 2},
                              std::vector<std::uint16_t>(2 * (TexelMap::kMostSide + 1)));
           }},
          {"1 to 16384",
           [&] {
             return load_with({0, 1, 2}, {});
           }},
          {"texel_map",
           [&] {
             return load_with({1, 1, 3}, {0, 0, 0});
           }},
      };
  for (const auto& [wanted, load] : refusals) {
    const auto loaded = load();
    ASSERT_FALSE(loaded) << wanted;
    EXPECT_EQ(loaded.error().code, Errc::kBadFormat);
    for (const std::string& part : {wanted, std::string("a.safetensors")})
      EXPECT_NE(loaded.error().what.find(part), std::string::npos) << loaded.error().what;
  }
}

TEST(MappedMaterial, IsRefusedWhereItCannotBeRight) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const auto map = [&] { return random_map(kWidth, kHeight, set.info().width, set.info().height); };
  const auto expect_refused =
      [&](Result<std::unique_ptr<Material>> material, TexelMap over, const std::string& why) {
        ASSERT_TRUE(material) << material.error().what;
        const auto mapped = with_texel_map(std::move(*material), std::move(over));
        ASSERT_FALSE(mapped) << why;
        EXPECT_EQ(mapped.error().code, Errc::kInvalidOption);
        EXPECT_NE(mapped.error().what.find(why), std::string::npos) << mapped.error().what;
      };
  FitOptions levels = options_with("1+1");
  levels.mip_levels = 2;
  expect_refused(fit("texel-colours", set, levels), map(), "mip levels");
  expect_refused(fit("phong", set, {}), random_map(2, 2, 3, 5), "5 x 3");
  expect_refused(
      fit("phong", set, {}).and_then([&](auto m) { return with_texel_map(std::move(m), map()); }),
      map(),
      "texel map");

  // One as large as its sample too: it is another picture.
  const auto mapped = fit("phong", set, {}).and_then([&](auto m) {
    return with_texel_map(std::move(m), random_map(5, 3, set.info().width, set.info().height));
  });
  ASSERT_TRUE(mapped) << mapped.error().what;
  SilentProgress progress;
  const auto evaluated = evaluate(set, **mapped, progress);
  ASSERT_FALSE(evaluated);
  EXPECT_EQ(evaluated.error().code, Errc::kBadFormat);
  EXPECT_NE(evaluated.error().what.find("texel map"), std::string::npos);
}

}  // namespace
}  // namespace veneer::btf
