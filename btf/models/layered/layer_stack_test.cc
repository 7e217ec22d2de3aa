// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_stack.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/testing/temporary_folder.h"
#include "btf/internal_test_sets.h"
#include "btf/models/layered/layered.h"

namespace veneer::btf {
namespace {

constexpr int kSide = 5;

LayerPoint grey(float diffuse, float transmittance) {
  LayerPoint point;
  point.diffuse.setConstant(diffuse);
  point.transmittance = transmittance;
  return point;
}

TEST(LayerStack, LightReachesTheTopInFull) {
  LayerStack stack(kSide, kSide, {1.0F, 0.0F});
  for (int texel = 0; texel < stack.texel_count(); ++texel)
    stack.set_point(0, texel, grey(0.5F, 0.25F));
  Pcg32 random(1);
  for (int i = 0; i < 100; ++i) {
    const Direction light = testing::random_direction(random, 0.01);
    EXPECT_EQ(stack.arriving(0, i % stack.texel_count(), light), 1.0);
    EXPECT_EQ(stack.arriving(1, i % stack.texel_count(), light), 0.25);
  }
}

TEST(LayerStack, ClearLayersOnTopChangeNothing) {
  LayerStack plane(kSide, kSide, {0.0F});
  LayerStack covered(kSide, kSide, {2.0F, 1.0F, 0.0F});
  Pcg32 random(2);
  for (int texel = 0; texel < plane.texel_count(); ++texel) {
    const LayerPoint point = grey(static_cast<float>(random.uniform()), 0.0F);
    plane.set_point(0, texel, point);
    covered.set_point(2, texel, point);
  }
  for (int i = 0; i < 200; ++i) {
    const Direction view = testing::random_direction(random);
    const Direction light = testing::random_direction(random);
    const int texel = i % plane.texel_count();
    EXPECT_EQ(plane.radiance(texel, view, light), covered.radiance(texel, view, light));
  }
}

LayerPoint any_point(Pcg32& random) {
  const auto number = [&random] { return static_cast<float>(random.uniform()); };
  LayerPoint point;
  point.diffuse = {number(), number(), number()};
  point.transmittance = number();
  point.specular = {number(), number(), number()};
  point.exponent = 1.0F + 60.0F * number();
  point.lobe = {-number(), -number(), number()};
  point.diffuse_radiance = 0.3F * number();
  point.normal = Eigen::Vector3f(number() - 0.5F, number() - 0.5F, 0.6F).normalized();
  return point;
}

LayerStack any_stack(std::uint64_t seed) {
  LayerStack stack(kSide, kSide, {2.0F, 0.5F, -1.0F});
  Pcg32 random(seed);
  for (int layer = 0; layer < stack.layer_count(); ++layer)
    for (int texel = 0; texel < stack.texel_count(); ++texel)
      stack.set_point(layer, texel, any_point(random));
  return stack;
}

// Equation 15 of Magda and Kriegman 2005, by hand.
TEST(LayerStack, OneLayerOnTheReferencePlaneIsLafortunesFormula) {
  LayerStack stack(kSide, kSide, {0.0F});
  Pcg32 random(4);
  for (int texel = 0; texel < stack.texel_count(); ++texel)
    stack.set_point(0, texel, any_point(random));
  for (int i = 0; i < 200; ++i) {
    const int texel = i % stack.texel_count();
    const Direction view = testing::random_direction(random);
    const Direction light = testing::random_direction(random, 1e-3);
    const LayerPoint at = stack.point(0, texel);
    const double base = at.lobe.cast<double>().dot(view.cwiseProduct(light));
    const double lobe = base > 0.0 ? std::pow(base, double(at.exponent)) : 0.0;
    const double cosine = std::max(0.0, at.normal.cast<double>().dot(light));
    const Eigen::Vector3d wanted =
        cosine * (at.diffuse.cast<double>() + lobe * at.specular.cast<double>());
    EXPECT_LT((stack.radiance(texel, view, light) - wanted).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// A plane that rises is seen, and shadows what lies below, elsewhere: towards the eye, or away from
// the light, by its height times the slope. Rows grow towards -y.
TEST(LayerStack, AHigherLayerIsSeenAndShadesAside) {
  LayerStack stack(kSide, kSide, {2.0F, 0.0F});
  const int dark = 2 * kSide + 2;
  for (int texel = 0; texel < stack.texel_count(); ++texel)
    stack.set_point(1, texel, grey(0.8F, 0));
  stack.set_point(0, dark, grey(0.0F, 0.0F));
  const Direction up = Direction::UnitZ();
  const Direction east = Direction(0.5, 0.0, 1.0).normalized();  // one texel over two of height
  const Direction north = Direction(0.0, 0.5, 1.0).normalized();
  for (int texel = 0; texel < stack.texel_count(); ++texel) {
    EXPECT_EQ(stack.radiance(texel, up, up)[0] == 0.0, texel == dark);
    EXPECT_EQ(stack.radiance(texel, east, up)[0] == 0.0, texel == dark - 1 || texel == dark);
    EXPECT_EQ(stack.radiance(texel, up, east)[0] == 0.0, texel == dark - 1 || texel == dark);
    EXPECT_EQ(stack.radiance(texel, north, up)[0] == 0.0, texel == dark + kSide || texel == dark);
  }
}

TEST(LayerStack, MovesWithItsTile) {
  const LayerStack stack = any_stack(5);
  LayerStack moved(kSide, kSide, {2.0F, 0.5F, -1.0F});
  const Eigen::Vector2i by(3, 1);
  for (int layer = 0; layer < stack.layer_count(); ++layer)
    for (int texel = 0; texel < stack.texel_count(); ++texel)
      moved.set_point(layer, stack.moved(texel, by), stack.point(layer, texel));
  Pcg32 random(6);
  for (int i = 0; i < 300; ++i) {
    const int texel = i % stack.texel_count();
    const Direction view = testing::random_direction(random);
    const Direction light = testing::random_direction(random);
    EXPECT_EQ(stack.radiance(texel, view, light),
              moved.radiance(stack.moved(texel, by), view, light));
  }
}

TEST(LayerStack, IsFiniteAtTheHorizonAndBelow) {
  const LayerStack stack = any_stack(7);
  for (const double z : {1.0, 1e-12, 0.0, -0.3}) {
    const Direction view(std::sqrt(1.0 - z * z), 0.0, z);
    for (const double of_light : {1.0, 1e-12}) {
      const Direction light(0.0, std::sqrt(1.0 - of_light * of_light), of_light);
      for (int texel = 0; texel < stack.texel_count(); ++texel) {
        const Eigen::Vector3d seen = stack.radiance(texel, view, light);
        EXPECT_TRUE(seen.allFinite());
        EXPECT_GE(seen.minCoeff(), 0.0);
      }
    }
    EXPECT_EQ(stack.radiance(0, view, {1.0, 0.0, 0.0}), Eigen::Vector3d::Zero());
  }
}

TEST(LayerStack, TheLowestLayerIsOpaqueAndTheTopOneHasNoDiffuseRadiance) {
  const LayerStack stack = any_stack(8);
  for (int texel = 0; texel < stack.texel_count(); ++texel) {
    EXPECT_EQ(stack.point(2, texel).transmittance, 0.0F);
    EXPECT_EQ(stack.point(0, texel).diffuse_radiance, 0.0F);
  }
}

TEST(LayerStack, ComesBackFromItsFileAsItWas) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "layers.safetensors";
  MaterialFrame frame;
  frame.width = frame.height = kSide;
  frame.views = frame.lights = testing::ring(5, 0.8);
  const LayerStack stack = any_stack(9);
  ASSERT_TRUE(save_material(*layered_material(frame, stack), path, {}));
  const auto loaded = load_material(path);
  ASSERT_TRUE(loaded) << loaded.error().what;
  Pcg32 random(10);
  for (int i = 0; i < 200; ++i) {
    const int texel = i % stack.texel_count();
    const Direction view = testing::random_direction(random);
    const Direction light = testing::random_direction(random);
    EXPECT_EQ((*loaded)->radiance(texel, view, light), stack.radiance(texel, view, light));
  }
}

}  // namespace
}  // namespace veneer::btf
