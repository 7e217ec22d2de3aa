// SPDX-License-Identifier: Apache-2.0
#include "render/internal_fitted_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "base/testing/temporary_folder.h"
#include "btf/fit_region.h"
#include "btf/mapped_material.h"
#include "btf/models/layered/layered.h"

namespace veneer::render {
namespace {

using btf::Direction;
using Eigen::Vector3d;

void fill(std::span<Eigen::half> out, const btf::SampleSetInfo& info, int texel) {
  Pcg32 random(static_cast<std::uint64_t>(texel), 3);
  const Vector3d colour(random.uniform(), random.uniform(), random.uniform());
  const double gloss = 0.3 * random.uniform();
  const double exponent = 3 + 20 * random.uniform();
  std::size_t i = 0;
  for (const Direction& view : info.views) {
    for (const Direction& light : info.lights) {
      const Direction mirrored(-light.x(), -light.y(), light.z());
      const double specular = gloss * std::pow(std::max(0.0, mirrored.dot(view)), exponent);
      for (int c = 0; c < 3; ++c) out[i++] = Eigen::half(static_cast<float>(specular));
      for (int c = 0; c < 3; ++c) out[i++] = Eigen::half(static_cast<float>(colour[c] * light.z()));
    }
  }
}

// Parts of the directions that a scene may ask for: a box of both; one light, of a box of views;
// one view; one light and a line of views.
std::vector<std::pair<std::string, btf::FitRegion>> regions() {
  btf::FitRegion part;
  part.views = {0.45, 0.85, 0.3, 0.7};
  part.lights = {0.2, 0.5, 0.25, 0.8};
  btf::FitRegion light = part;
  light.lights = {0.3, 0.3, 0.6, 0.6};
  btf::FitRegion view = part;
  view.views = {0.62, 0.62, 0.4, 0.4};
  btf::FitRegion line = light;
  line.views.v_max = line.views.v_min;
  return {{"in a box", part}, {"one light", light}, {"one view", view}, {"a line", line}};
}

// Every model in the forms of `components` that it knows, with weights in one texel and in two; the
// other ways to keep and to cluster the specular term; in parts of the directions; with a texel
// map; with mip levels; and stacks of layers.
std::vector<Fitted> fit_all(const btf::SampleSet& set) {
  std::vector<Fitted> all;
  SilentProgress progress;
  for (const btf::Model& model : btf::models()) {
    const std::size_t before = all.size();
    std::string refusals;
    for (const char* components : {"5", "3+1", "6+2"}) {
      if (model.terms == 0 && all.size() > before) break;  // it does not read them
      auto material = model.fit(set, quick_options(components), progress);
      if (material) {
        all.push_back({fmt::format("{} {}", model.name, components), std::move(*material)});
      } else {
        EXPECT_EQ(material.error().code, Errc::kInvalidOption) << material.error().what;
        refusals += material.error().what + "\n";
      }
    }
    EXPECT_GT(all.size(), before) << model.name << " fits in no form:\n" << refusals;
  }
  for (const auto& [specular, clustering] :
       {std::pair{"half-angle", "joint"}, {"product", "separate"}, {"half-angle", "separate"}}) {
    btf::FitOptions options = quick_options("5+5");
    options.specular = specular;
    options.clustering = clustering;
    auto material = (*btf::find_model("dichromatic-lpca"))->fit(set, options, progress);
    EXPECT_TRUE(material) << material.error().what;
    if (material)
      all.push_back(
          {fmt::format("dichromatic-lpca {} {}", specular, clustering), std::move(*material)});
  }
  const auto cropped = regions();
  for (const btf::Model& model : btf::models())
    for (const auto& [name, region] : cropped) {
      btf::FitOptions options = quick_options(model.terms == 2 ? "3+1" : "3");
      options.region = &region;
      auto material = model.fit(set, options, progress);
      EXPECT_TRUE(material) << material.error().what;
      if (material) all.push_back({fmt::format("{} {}", model.name, name), std::move(*material)});
    }
  for (const btf::Model& model : btf::models()) {
    auto material = model.fit(set, quick_options(model.terms == 2 ? "3+1" : "3"), progress);
    EXPECT_TRUE(material) << material.error().what;
    if (!material) continue;
    auto mapped = btf::with_texel_map(std::move(*material), random_map(kTexels, 2));
    EXPECT_TRUE(mapped) << mapped.error().what;
    if (mapped) all.push_back({fmt::format("{} with a texel map", model.name), std::move(*mapped)});
  }
  btf::FitOptions options = quick_options("3+1");
  options.mip_levels = kMipLevels;
  auto material = (*btf::find_model("texel-colours"))->fit(set, options, progress);
  EXPECT_TRUE(material) << material.error().what;
  if (material) all.push_back({kWithMipLevels, std::move(*material)});
  Pcg32 random(31);
  for (int layers = 1; layers <= btf::LayerStack::kMostLayers; ++layers) {
    btf::MaterialFrame frame;
    frame.width = frame.height = kTexels;
    frame.views = frame.lights = btf::bonn_directions();
    all.push_back({fmt::format("layered by hand, {}", layers),
                   btf::layered_material(std::move(frame), random_stack(layers, random))});
  }
  return all;
}

}  // namespace

Result<btf::SampleSet> make_samples(const std::filesystem::path& folder) {
  btf::SampleSetInfo info;
  info.width = info.height = kTexels;
  info.polarised = true;
  info.views = info.lights = btf::bonn_directions();
  info.source = "analytic";
  info.licence = "Apache-2.0";
  VENEER_ASSIGN(auto writer, btf::SampleSetWriter::create(folder, info));
  for (int texel = 0; texel < info.texel_count(); ++texel) fill(writer.texel(texel), info, texel);
  VENEER_TRY(writer.finish());
  return btf::SampleSet::open(folder);
}

btf::FitOptions quick_options(const char* components) {
  btf::FitOptions options;
  options.clusters = 3;
  options.components = components;
  options.angular = 8;
  options.basis = 24;  // of 64 texels
  options.iterations = 5;
  return options;
}

btf::LayerStack random_stack(int layers, Pcg32& random) {
  std::vector<float> heights{static_cast<float>(3 * random.uniform())};
  while (std::ssize(heights) < layers)
    heights.push_back(heights.back() - static_cast<float>(0.05 + 1.5 * random.uniform()));
  btf::LayerStack stack(kTexels, kTexels, heights);
  const auto number = [&random] { return static_cast<float>(random.uniform()); };
  for (int layer = 0; layer < layers; ++layer) {
    for (int texel = 0; texel < stack.texel_count(); ++texel) {
      btf::LayerPoint point;
      point.diffuse = {number(), number(), number()};
      const std::uint32_t kind = random.next() % 3;
      point.transmittance = kind == 0 ? 0.0F : kind == 1 ? 1.0F : number();
      point.specular = 0.3F * Eigen::Vector3f(number(), number(), number());
      point.exponent = 1 + 29 * number();
      point.lobe = {-0.5F - 0.5F * number(), -0.5F - 0.5F * number(), 0.5F + 0.5F * number()};
      point.diffuse_radiance = 0.2F * number();
      point.normal = Eigen::Vector3f(number() - 0.5F, number() - 0.5F, 0.3F).normalized();
      stack.set_point(layer, texel, point);
    }
  }
  return stack;
}

btf::TexelMap random_map(int side, std::uint64_t seed) {
  Pcg32 random(seed);
  std::vector<btf::TexelMap::Source> sources;
  for (int i = 0; i < side * side; ++i)
    sources.push_back({static_cast<std::uint16_t>(random.next() % kTexels),
                       static_cast<std::uint16_t>(random.next() % kTexels)});
  auto map = btf::TexelMap::create(side, side, std::move(sources), kTexels, kTexels);
  EXPECT_TRUE(map) << map.error().what;
  return std::move(*map);
}

const std::vector<Fitted>& fitted() {
  static const TemporaryFolder kFolder;
  static const auto kSet = make_samples(kFolder.path() / "analytic.btfset");
  static const std::vector<Fitted> kAll = [] {
    EXPECT_TRUE(kSet) << kSet.error().what;
    return kSet ? fit_all(*kSet) : std::vector<Fitted>();
  }();
  return kAll;
}

}  // namespace veneer::render
