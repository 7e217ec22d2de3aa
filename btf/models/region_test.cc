// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "btf/elevated_concentric.h"
#include "btf/evaluation.h"
#include "btf/fit_region.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/internal_test_models.h"
#include "btf/spherical_interpolation.h"

// Fits that are weighted and cropped to a part of the directions: FitOptions::region.
namespace veneer::btf {
namespace {

using testing::components_of;
using testing::fit;
using testing::make_set;
using testing::options_with;
using testing::random_direction;
using testing::small_info;

// The same numbers in another order of rounding.
constexpr double kRounding = 1e-3;  // of an error

// Texels of more kinds than there are components: a body, and a highlight that leans and widens.
float leaning(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  Pcg32 random(static_cast<std::uint64_t>(texel), 5);
  const Direction normal =
      Direction(0.5 * random.uniform() - 0.25, 0.5 * random.uniform() - 0.25, 1.0).normalized();
  const double exponent = 4.0 + 12.0 * random.uniform();
  const Direction& l = info.lights[static_cast<std::size_t>(light)];
  const Direction half = (info.views[static_cast<std::size_t>(view)] + l).normalized();
  const double shine = 0.4 * std::pow(std::max(half.dot(normal), 0.0), exponent) * l.z();
  const double body = (0.1 + 0.02 * texel * (channel % 3 + 1)) * std::max(normal.dot(l), 0.0);
  return static_cast<float>(info.polarised && channel < 3 ? shine
                            : info.polarised              ? body
                                                          : body + shine);
}

SampleSet leaning_set(const std::filesystem::path& folder, const SampleSetInfo& info) {
  return make_set(folder, info, [info](int texel, int view, int light, int channel) {
    return leaning(info, texel, view, light, channel);
  });
}

std::unique_ptr<Material> fitted(const Model& model,
                                 const SampleSet& set,
                                 const FitRegion* region,
                                 int angular = 12) {
  FitOptions options = options_with(components_of(model, "2", "1+1"), 3);
  options.region = region;
  options.angular = angular;
  options.iterations = 8;
  auto material = fit(model.name, set, options);
  EXPECT_TRUE(material) << model.name << ": " << material.error().what;
  return material ? std::move(*material) : nullptr;
}

double rmse(const SampleSet& set, const Material& material, const PairWeights* weights) {
  SilentProgress progress;
  const auto evaluation = evaluate(set, material, progress, weights);
  EXPECT_TRUE(evaluation) << evaluation.error().what;
  return evaluation ? evaluation->linear.rmse : std::numeric_limits<double>::quiet_NaN();
}

void expect_same_contents(const Material& a, const Material& b) {
  const Material::Contents left = a.contents();
  const Material::Contents right = b.contents();
  ASSERT_EQ(left.tensors.size(), right.tensors.size()) << a.model();
  EXPECT_EQ(left.metadata, right.metadata) << a.model();
  for (std::size_t i = 0; i < left.tensors.size(); ++i) {
    const Material::Contents::Tensor& one = left.tensors[i];
    EXPECT_TRUE(std::ranges::equal(one.bytes, right.tensors[i].bytes))
        << a.model() << " " << one.spec.name;
  }
}

PairWeights weights_of(const SampleSetInfo& info, const std::function<double(int, int)>& weight) {
  PairWeights weights;
  for (int v = 0; v < std::ssize(info.views); ++v)
    for (int l = 0; l < std::ssize(info.lights); ++l)
      weights.weight.push_back(static_cast<float>(weight(v, l)));
  return weights;
}

DirectionBox point_at(const Direction& direction) {
  const Eigen::Vector2d at = square_from_direction(direction);
  return {at.x(), at.x(), at.y(), at.y()};
}

bool has_grid(const Model& model) {
  return model.name == "revised-lpca" || model.name == "texel-colours" ||
         model.name == "dichromatic-lpca";
}

class Region : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleSetInfo info_ = small_info(true);
  SampleSet set_ = leaning_set(folder_.path() / "a.btfset", info_);
};

TEST_F(Region, WeightsThatAreAllOneChangeNotABit) {
  FitRegion alike;
  alike.weights = weights_of(info_, [](int, int) { return 1.0; });
  for (const Model& model : models()) {
    const auto plain = fitted(model, set_, nullptr);
    const auto weighted = fitted(model, set_, &alike);
    ASSERT_TRUE(plain && weighted);
    expect_same_contents(*plain, *weighted);
  }
}

TEST_F(Region, OnlyRatiosOfWeightsMatter) {
  Pcg32 random(2);
  FitRegion region;
  region.weights = weights_of(info_, [&](int, int) { return 0.1 + random.uniform(); });
  FitRegion scaled = region;
  for (float& weight : scaled.weights.weight) weight *= 1024.0F;  // exact in float
  for (const Model& model : models()) {
    const auto a = fitted(model, set_, &region);
    const auto b = fitted(model, set_, &scaled);
    ASSERT_TRUE(a && b);
    expect_same_contents(*a, *b);
  }
}

// Directions without any weight are as if they had not been measured.
TEST_F(Region, DirectionsWithoutWeightAreDropped) {
  SampleSetInfo part = info_;
  part.views.assign(info_.views.begin() + 1, info_.views.begin() + 4);
  part.lights.assign(info_.lights.begin(), info_.lights.begin() + 5);
  const SampleSet of_part =
      make_set(folder_.path() / "b.btfset", part, [&](int texel, int view, int light, int channel) {
        return leaning(info_, texel, view + 1, light, channel);
      });
  FitRegion region;
  region.weights =
      weights_of(info_, [](int v, int l) { return v >= 1 && v < 4 && l < 5 ? 0.5 : 0.0; });
  for (const Model& model : models()) {
    const auto cropped = fitted(model, set_, &region);
    const auto of_less = fitted(model, of_part, nullptr);
    ASSERT_TRUE(cropped && of_less);
    EXPECT_EQ(cropped->views(), part.views);
    EXPECT_EQ(cropped->lights(), part.lights);
    expect_same_contents(*cropped, *of_less);
    // And so is what is compared.
    EXPECT_EQ(rmse(set_, *cropped, &region.weights), rmse(of_part, *of_less, nullptr));
  }
}

// A pair that counts nothing though its view and its light do: the others are met as well as if it
// did not exist, whatever it shows.
TEST_F(Region, PairsWithoutWeightDoNotCount) {
  const auto counts = [](int v, int l) { return (v + l) % 3 != 0; };
  const SampleSet other = make_set(
      folder_.path() / "b.btfset", info_, [&](int texel, int view, int light, int channel) {
        const float value = leaning(info_, texel, view, light, channel);
        return counts(view, light) ? value : 0.3F * value + 0.4F;
      });
  FitRegion region;
  region.weights = weights_of(info_, [&](int v, int l) { return counts(v, l) ? 1.0 : 0.0; });
  for (const Model& model : models()) {
    if (model.terms == 0) continue;  // formulas let such pairs count a millionth
    const auto a = fitted(model, set_, &region);
    const auto b = fitted(model, other, &region);
    ASSERT_TRUE(a && b);
    const double error = rmse(set_, *a, &region.weights);
    EXPECT_GT(error, 0.0) << model.name;
    EXPECT_NEAR(rmse(other, *b, &region.weights), error, 0.05 * error + kRounding) << model.name;
  }
}

TEST_F(Region, AWeightedFitIsTheBetterOneWhereTheWeightIs) {
  FitRegion region;
  region.weights = weights_of(info_, [](int v, int) { return v == 2 ? 1.0 : 1e-3; });
  for (const Model& model : models()) {
    const auto general = fitted(model, set_, nullptr);
    const auto weighted = fitted(model, set_, &region);
    ASSERT_TRUE(general && weighted);
    EXPECT_LE(rmse(set_, *weighted, &region.weights),
              (1.0 + kRounding) * rmse(set_, *general, &region.weights))
        << model.name;
  }
}

TEST_F(Region, WrongRegionsAreRefusedByEveryModel) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::vector<FitRegion> wrong(6);
  wrong[0].weights.weight.assign(3, 1.0F);
  wrong[1].weights = weights_of(info_, [](int v, int) { return v == 1 ? -1.0 : 1.0; });
  wrong[2].weights = weights_of(info_, [](int, int) { return 0.0; });
  wrong[3].views = {0.6, 0.4, 0.0, 1.0};
  wrong[4].lights = {0.0, 1.5, 0.0, 1.0};
  wrong[5].lights = {0.0, kNan, 0.0, 1.0};
  for (const Model& model : models())
    for (const FitRegion& region : wrong) {
      FitOptions options = options_with(components_of(model, "2", "1+1"));
      options.region = &region;
      const auto refused = fit(model.name, set_, options);
      ASSERT_FALSE(refused) << model.name;
      EXPECT_EQ(refused.error().code, Errc::kInvalidOption) << refused.error().what;
    }
}

// The boxes of the laws below: a part of the hemisphere, a line, one light, one view, one pair.
std::vector<FitRegion> boxes(const SampleSetInfo& info) {
  const DirectionBox part{0.55, 0.8, 0.3, 0.7};
  std::vector<FitRegion> all(5);
  all[0].views = all[0].lights = part;
  all[1].views = part;
  all[1].lights = {0.3, 0.3, 0.2, 0.7};
  all[2].views = part;
  all[2].lights = point_at(info.lights[3]);
  all[3].views = point_at(Direction(0.3, 0.1, 1.0).normalized());
  all[4].views = point_at(info.views[1]);
  all[4].lights = point_at(Direction(-0.2, 0.4, 1.0).normalized());
  return all;
}

Direction inside(const DirectionBox& box, Pcg32& random) {
  return direction_from_square({box.u_min + (box.u_max - box.u_min) * random.uniform(),
                                box.v_min + (box.v_max - box.v_min) * random.uniform()});
}

TEST_F(Region, OutsideABoxIsFiniteAndOfItsBorder) {
  for (const FitRegion& region : boxes(info_))
    for (const Model& model : models()) {
      const auto material = fitted(model, set_, &region);
      ASSERT_TRUE(material);
      Pcg32 random(4);
      for (int i = 0; i < 200; ++i) {
        const Direction view = random_direction(random, -0.1);
        const Direction light = random_direction(random, -0.1);
        const Eigen::Vector3d seen = material->radiance(i % 15, view, light);
        ASSERT_TRUE(seen.allFinite() && seen.minCoeff() >= 0.0) << model.name;
        // Only those with a grid know a box; and the second form of theirs fades by the cosine.
        if (!has_grid(model) || light.z() <= 0.01) continue;
        const auto clamped = [](const DirectionBox& box, const Direction& d) {
          const Eigen::Vector2d at = square_from_direction(d);
          return direction_from_square(
              {std::clamp(at.x(), box.u_min, box.u_max), std::clamp(at.y(), box.v_min, box.v_max)});
        };
        const Direction border = clamped(region.lights, light);
        if (border.z() <= 0.01) continue;
        // The shader's map is not the exact one.
        EXPECT_LT((seen - material->radiance(i % 15, clamped(region.views, view), border)).norm(),
                  0.02)
            << model.name;
      }
    }
}

TEST_F(Region, BoxesSurviveAFileAndFilesWithoutThemAreWhole) {
  const auto path = folder_.path() / "a.safetensors";
  for (const FitRegion& region : boxes(info_))
    for (const Model& model : models()) {
      const auto material = fitted(model, set_, &region);
      ASSERT_TRUE(material);
      const Status saved = save_material(*material, path, {});
      ASSERT_TRUE(saved) << saved.error().what;
      const auto loaded = load_material(path);
      ASSERT_TRUE(loaded) << loaded.error().what;
      expect_same_contents(*material, **loaded);
      const ModelShader a = material->shader();
      const ModelShader b = (*loaded)->shader();
      EXPECT_EQ(a.source, b.source);
      EXPECT_EQ(a.fetches, b.fetches);
      EXPECT_EQ(a.gpu_bytes(), b.gpu_bytes());
      for (const ModelTexture& texture : a.textures)
        EXPECT_EQ(texture.data.size(),
                  static_cast<std::size_t>(texture.width) * texture.height * texture.depth *
                      bytes_per_texel(texture.format));
    }
  const auto whole = fitted(**find_model("revised-lpca"), set_, nullptr);
  for (const auto& tensor : whole->contents().tensors) EXPECT_NE(tensor.spec.name, "boxes");
}

TEST_F(Region, AFixedLightOrViewHalvesTheFetchesOfVolumes) {
  for (const char* name : {"revised-lpca", "texel-colours"}) {
    const Model& model = **find_model(name);
    const auto general = fitted(model, set_, nullptr)->shader();
    FitRegion light;
    light.lights = point_at(info_.lights[2]);
    FitRegion view;
    view.views = point_at(info_.views[2]);
    for (const FitRegion& region : {light, view}) {
      const ModelShader cropped = fitted(model, set_, &region)->shader();
      const int volumes = model.terms == 2 ? 1 : 2;
      EXPECT_EQ(cropped.fetches, general.fetches - volumes) << name;
      EXPECT_LT(cropped.gpu_bytes(), general.gpu_bytes() / 50) << name;
    }
  }
}

// With as many nodes in a part of the hemisphere as on the whole, what is drawn there comes closer
// to the data: never further, for any model of a grid.
TEST_F(Region, ACroppedGridDrawsItsPartAtLeastAsWell) {
  info_.views = info_.lights = bonn_directions();
  info_.width = 2;
  info_.height = 1;
  const SampleSet set = leaning_set(folder_.path() / "bonn.btfset", info_);
  const SphericalInterpolator views(info_.views, DirectionRole::kView);
  const SphericalInterpolator lights(info_.lights, DirectionRole::kLight);
  FitRegion region;
  region.views = {0.5, 0.75, 0.25, 0.5};
  region.lights = {0.25, 0.5, 0.5, 0.75};
  const auto drawn_error = [&](const Material& material) {
    Pcg32 random(6);
    double sum = 0.0;
    for (int i = 0; i < 600; ++i) {
      const Direction view = inside(region.views, random);
      const Direction light = inside(region.lights, random);
      const DirectionWeights v = views.weights(view);
      const DirectionWeights l = lights.weights(light);
      const int texel = i % 2;
      double wanted = 0.0;
      std::vector<float> rgb(static_cast<std::size_t>(info_.pair_count()) * 3);
      set.rgb(texel, Part::kTotal, rgb);
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          wanted += l.scale * v.weight[a] * l.weight[b] *
                    double(rgb[static_cast<std::size_t>(3 * (v.index[a] * 81 + l.index[b]))]);
      sum += std::pow(material.radiance(texel, view, light)[0] - wanted, 2);
    }
    return std::sqrt(sum / 600);
  };
  for (const Model& model : models()) {
    if (!has_grid(model)) continue;
    const auto general = fitted(model, set, nullptr, 8);
    const auto cropped = fitted(model, set, &region, 32);  // a quarter of each side: 8 nodes
    ASSERT_TRUE(general && cropped);
    EXPECT_LE(cropped->shader().gpu_bytes(), general->shader().gpu_bytes());
    EXPECT_LT(drawn_error(*cropped), drawn_error(*general)) << model.name;
  }
}

TEST_F(Region, ABadBoxInAFileIsRefused) {
  FitRegion region;
  region.views = {0.2, 0.6, 0.2, 0.6};
  const auto material = fitted(**find_model("texel-colours"), set_, &region);
  class Changed final : public Material {
   public:
    Changed(const Material& of, const std::vector<double>& boxes) : of_(of), boxes_(boxes) {}
    std::string_view model() const override { return of_.model(); }
    int width() const override { return of_.width(); }
    int height() const override { return of_.height(); }
    const DirectionSet& views() const override { return of_.views(); }
    const DirectionSet& lights() const override { return of_.lights(); }
    void reconstruct(int, std::span<float>) const override {}
    Eigen::Vector3d radiance(int, const Direction&, const Direction&) const override { return {}; }
    ModelShader shader() const override { return {}; }
    double values_per_texel() const override { return 0.0; }
    Contents contents() const override {
      Contents contents = of_.contents();
      for (Contents::Tensor& tensor : contents.tensors)
        if (tensor.spec.name == "boxes") tensor.bytes = std::as_bytes(std::span(boxes_));
      return contents;
    }

   private:
    const Material& of_;
    const std::vector<double>& boxes_;
  };
  const auto path = folder_.path() / "bad.safetensors";
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const std::vector<double>& boxes : {std::vector<double>{0.6, 0.2, 0, 1, 0, 1, 0, 1},
                                           {0, 1, 0, 1, 0, 1, -0.1, 1},
                                           {0, 1, 0, nan, 0, 1, 0, 1}}) {
    ASSERT_TRUE(save_material(Changed(*material, boxes), path, {}));
    const auto refused = load_material(path);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kBadFormat) << refused.error().what;
    EXPECT_NE(refused.error().what.find("box"), std::string::npos) << refused.error().what;
  }
}

TEST_F(Region, EvaluationCountsPairsByTheirWeights) {
  const auto material = fitted(**find_model("lpca"), set_, nullptr);
  // The squares of all pairs are the sum of those of one view and of the others.
  const PairWeights one = weights_of(info_, [](int v, int) { return v == 0 ? 1.0 : 0.0; });
  const PairWeights others = weights_of(info_, [](int v, int) { return v == 0 ? 0.0 : 1.0; });
  const double n = static_cast<double>(info_.views.size());
  EXPECT_NEAR(std::pow(rmse(set_, *material, nullptr), 2) * n,
              std::pow(rmse(set_, *material, &one), 2) +
                  (n - 1) * std::pow(rmse(set_, *material, &others), 2),
              1e-9);
  SilentProgress progress;
  FitRegion region;
  region.weights = one;
  const auto cropped = fitted(**find_model("lpca"), set_, &region);
  const auto refused = evaluate(set_, *cropped, progress, &others);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat) << refused.error().what;
  PairWeights few;
  few.weight = {1.0F};
  EXPECT_FALSE(evaluate(set_, *material, progress, &few));
}

}  // namespace
}  // namespace veneer::btf
