// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/point_solver.h"

#include <gtest/gtest.h>

#include <cmath>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

using testing::random_direction;

// What one point shows to some views, with a third of the lights in shadow.
struct Scene {
  Eigen::ArrayX3f lights;
  Eigen::ArrayXf shade;
  std::vector<PointView> views;
  std::vector<int> order;
};

LightRows sent(const LayerPoint& point, const Scene& scene, const PointView& view) {
  Eigen::ArrayXf lobe;
  lobe_rows(point, view.u, lobe);
  const Eigen::ArrayXf shine = (scene.lights.matrix() * point.normal).array().max(0.0F) *
                               (scene.shade + point.diffuse_radiance);
  LightRows rows(lobe.size(), 3);
  for (int c = 0; c < 3; ++c) rows.col(c) = shine * (point.diffuse[c] + point.specular[c] * lobe);
  return rows;
}

Scene scene_of(const LayerPoint& truth, std::uint64_t seed) {
  Pcg32 random(seed);
  Scene scene;
  constexpr int kLights = 40;
  scene.lights.resize(kLights, 3);
  scene.shade.setOnes(kLights);
  for (int i = 0; i < kLights; ++i) {
    scene.lights.row(i) = random_direction(random, 0.2).cast<float>().transpose();
    if (i % 3 == 0) scene.shade[i] = 0.0F;
  }
  for (int v = 0; v < 30; ++v) {
    PointView& view = scene.views.emplace_back();
    scene.order.push_back(v);
    view.u =
        scene.lights.rowwise() * random_direction(random, 0.2).cast<float>().transpose().array();
    view.below.setZero(kLights, 3);
    view.wanted = sent(truth, scene, view);
  }
  return scene;
}

double error_of(const LayerPoint& point, const Scene& scene) {
  double error = 0.0;
  for (const PointView& view : scene.views)
    error += double((sent(point, scene, view) - view.wanted).square().sum());
  return error;
}

TEST(PointSolver, FindsColoursLobeNormalAndRadianceAgain) {
  LayerPoint truth;
  truth.diffuse = {0.4F, 0.3F, 0.2F};
  truth.specular = {0.2F, 0.2F, 0.1F};
  truth.exponent = 7.0F;
  truth.normal = Eigen::Vector3f(0.2F, -0.3F, 1.0F).normalized();
  truth.diffuse_radiance = 0.1F;
  truth.transmittance = 0.0F;
  const Scene scene = scene_of(truth, 3);
  LayerPoint point = start_of(scene.views, scene.order, scene.shade, scene.lights);
  point.transmittance = 0.0F;
  const double before = error_of(point, scene);
  for (int pass = 0; pass < 6; ++pass) {
    PointSolver solver(point, true, 2.0F);
    for (const PointView& view : scene.views) solver.add(view, scene.shade, scene.lights);
    ASSERT_TRUE(solver.step(1.0));
    point = solver.point();
  }
  // Quadratic at the end: what is left is the rounding of floats.
  EXPECT_LT(error_of(point, scene), 1e-10 * before);
  EXPECT_NEAR(point.diffuse_radiance, truth.diffuse_radiance, 1e-4);
  EXPECT_NEAR(point.exponent, truth.exponent, 1e-3);
  EXPECT_GT(point.normal.dot(truth.normal), 1.0F - 1e-6F);
}

TEST(PointSolver, StaysWhereNothingIsSaid) {
  const LayerPoint start;
  PointSolver solver(start, true, 1.0F);
  EXPECT_FALSE(solver.step(1.0));
  EXPECT_EQ(solver.point().diffuse, start.diffuse);
}

TEST(PointSolver, GivesFiniteNumbersForBlackAndForHugeSamples) {
  for (const float level : {0.0F, 1e-20F, 1e4F}) {
    LayerPoint truth;
    truth.diffuse.setConstant(level);
    truth.transmittance = 0.0F;
    const Scene scene = scene_of(truth, 5);
    PointSolver solver(
        start_of(scene.views, scene.order, scene.shade, scene.lights), true, 4.0F * level);
    for (int pass = 0; pass < 4; ++pass) {
      for (const PointView& view : scene.views) solver.add(view, scene.shade, scene.lights);
      solver.step(0.95);
    }
    const LayerPoint& point = solver.point();
    EXPECT_TRUE(point.diffuse.allFinite() && point.specular.allFinite() && point.lobe.allFinite());
    EXPECT_GE(point.diffuse.minCoeff(), 0.0F);
    EXPECT_NEAR(point.normal.norm(), 1.0F, 1e-5F);
    EXPECT_TRUE(point.exponent >= 1.0F && point.exponent <= 200.0F);
  }
}

}  // namespace
}  // namespace veneer::btf
