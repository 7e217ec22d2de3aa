// SPDX-License-Identifier: Apache-2.0
#include "render/eye_view.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "btf/models/layered/layered.h"
#include "render/egl_context.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr int kTexels = 8;  // along a side
constexpr double kSphereRadius = 0.1;

bool has_gl() { return static_cast<bool>(EglContext::create()); }

std::unique_ptr<btf::Material> material_of(btf::LayerStack stack) {
  btf::MaterialFrame frame;
  frame.width = frame.height = kTexels;
  frame.views = frame.lights = btf::bonn_directions();
  return btf::layered_material(std::move(frame), std::move(stack));
}

enum class Upper { kMixed, kClear };

// Colours, normals and transmittances that differ from texel to texel.
btf::LayerStack random_stack(const std::vector<float>& heights, Upper upper = Upper::kMixed) {
  Pcg32 random(41);
  btf::LayerStack stack(kTexels, kTexels, heights);
  const auto number = [&random] { return static_cast<float>(random.uniform()); };
  for (int layer = 0; layer < stack.layer_count(); ++layer) {
    for (int texel = 0; texel < stack.texel_count(); ++texel) {
      btf::LayerPoint point;
      point.diffuse = {0.2F + number(), 0.2F + number(), 0.2F + number()};
      point.transmittance = number() < 0.5F ? 1.0F : 0.5F * number();
      if (point.transmittance == 1.0F && layer + 1 < stack.layer_count()) point.diffuse.setZero();
      point.diffuse_radiance = 0.1F * number();
      point.normal = Eigen::Vector3f(number() - 0.5F, number() - 0.5F, 1.0F).normalized();
      if (upper == Upper::kClear && layer + 1 < stack.layer_count()) continue;
      stack.set_point(layer, texel, point);
    }
  }
  return stack;
}

Scene scene_of(const std::string& mesh, const Eigen::Vector2d& repeats) {
  Scene scene;
  scene.mesh = *load_mesh(mesh);
  scene.mesh_name = mesh;
  scene.texture_repeats = repeats;
  scene.lights = {DirectionalLight{Vector3d(0.4, 0.3, 0.8).normalized(), Vector3d::Constant(300)},
                  PointLight{{-0.6, 0.4, 0.7}, {60, 50, 40}}};
  return scene;
}

EyeView view_from(const Vector3d& eye, bool shells) {
  EyeView view;
  view.eye_in_world = eye;
  view.width = 240;
  view.height = 200;
  view.samples = 1;
  view.shells = shells;
  return view;
}

double largest_difference(const EyePicture& a, const EyePicture& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.radiance_xyz.pixels().size(); ++i)
    largest = std::max(
        largest,
        double((a.radiance_xyz.pixels()[i] - b.radiance_xyz.pixels()[i]).cwiseAbs().maxCoeff()));
  return largest;
}

double largest_difference_hidden(const EyePicture& a, const EyePicture& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.hidden.pixels().size(); ++i)
    largest = std::max(largest, double(std::abs(a.hidden.pixels()[i] - b.hidden.pixels()[i])));
  return largest;
}

double brightest(const EyePicture& picture) {
  double most = 0;
  for (const Rgb32f& pixel : picture.radiance_xyz.pixels())
    most = std::max(most, double(pixel.maxCoeff()));
  return most;
}

// Of the disc that covers as much as the object does, pixels.
double disc_radius(const EyePicture& picture) {
  double area = 0;
  for (const float hidden : picture.hidden.pixels()) area += double(hidden);
  return std::sqrt(area / std::numbers::pi);
}

// Sums of a few numbers, in float.
constexpr double kRounding = 1e-5;

TEST(Shells, WithNothingAboveTheSurfaceAreThePlainDraw) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  const auto material = material_of(random_stack({3.0F, 1.0F, 0.0F}, Upper::kClear));
  for (const char* mesh : {"sphere", "vase"}) {
    Scene scene = scene_of(mesh, {6, 3});
    scene.world_from_object.translation = {0.1, -0.05, 0.02};
    scene.world_from_object.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(0.6, Vector3d(1, 2, 3).normalized()));
    for (const Vector3d& eye : {Vector3d(0.2, 0.1, 0.5), Vector3d(-2, 1, -1)}) {
      SCOPED_TRACE(fmt::format("{} from z = {}", mesh, eye.z()));
      const auto plain = draw_from_eye(scene, *material, view_from(eye, false));
      ASSERT_TRUE(plain) << plain.error().what;
      const auto shells = draw_from_eye(scene, *material, view_from(eye, true));
      ASSERT_TRUE(shells) << shells.error().what;
      EXPECT_GT(brightest(*plain), 10);
      EXPECT_LE(largest_difference(*plain, *shells), kRounding * brightest(*plain));
      EXPECT_LE(largest_difference_hidden(*plain, *shells), kRounding);
      EXPECT_GT(disc_radius(*plain), 50);
    }
  }
}

TEST(Shells, ASurfaceHidesFromBehindToo) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  const auto material = material_of(random_stack({1.0F, 0.0F}, Upper::kClear));
  const Scene scene = scene_of("plate", {6, 3});
  for (const double z : {0.9, -0.9}) {
    const Vector3d eye(0.3, 0.2, z);
    for (const bool shells : {false, true}) {
      const auto picture = draw_from_eye(scene, *material, view_from(eye, shells));
      ASSERT_TRUE(picture) << picture.error().what;
      EXPECT_GT(disc_radius(*picture), 30) << z << shells;
      EXPECT_EQ(brightest(*picture) > 0, z > 0) << "it has one side";
    }
  }
}

// A ball of radius r at distance d is seen as a disc of f r / sqrt(d^2 - r^2) pixels. Flat
// triangles cover a little less.
TEST(Shells, EnlargeABallByTheirHeight) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  const Scene scene = scene_of("sphere", {6, 3});
  const Vector3d eye(0.3, 0.2, 0.9);
  const auto expected = [&](const EyeView& view, double radius, double beyond_m) {
    const auto geometry = geometry_of_eye(scene, view, beyond_m);
    return geometry->fx * radius / std::sqrt(eye.squaredNorm() - radius * radius);
  };
  for (const std::vector<float>& heights :
       {std::vector{1.5F}, {-1.5F}, {0.0F}, {2.0F, 0.0F}, {0.5F, -3.0F}}) {
    btf::LayerStack stack = random_stack(heights);
    for (int texel = 0; texel < stack.texel_count(); ++texel) {
      btf::LayerPoint point = stack.point(0, texel);
      point.transmittance = 0.0F;
      stack.set_point(0, texel, point);
    }
    const auto material = material_of(stack);
    const auto shells = draw_from_eye(scene, *material, view_from(eye, true));
    ASSERT_TRUE(shells) << shells.error().what;
    ASSERT_TRUE(shells->texel);
    const double thickness = heights[0] * shells->texel->mean_m;
    const double beyond = std::max(0.0, thickness);
    const EyeView view = view_from(eye, true);
    EXPECT_NEAR(disc_radius(*shells), expected(view, kSphereRadius + thickness, beyond), 1.0);
    if (heights[0] != 0.0F) {
      EXPECT_GT(std::abs(expected(view, kSphereRadius, beyond) - disc_radius(*shells)), 3.0);
    }
    const auto plain = draw_from_eye(scene, *material, view_from(eye, false));
    ASSERT_TRUE(plain) << plain.error().what;
    EXPECT_NEAR(disc_radius(*plain), expected(view, kSphereRadius, beyond), 1.0);
  }
}

// From far a shell moved up by a height is seen where the model's parallax says. Pixels whose texel
// has its border in them may show either, as the view turns by 0.1 / 60 over the plate.
TEST(Shells, OfAPlateFromFarAreTheModelsParallax) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  constexpr double kMostAtBorders = 0.02;
  Scene scene = scene_of("plate", {2, 2});
  scene.lights.resize(1);  // the one that is far: a near one stands elsewhere for a shell's point
  const std::vector<float> heights{1.2F, 0.5F, -0.7F};
  const auto material = material_of(random_stack(heights));
  const auto flat = material_of(random_stack({0.002F, 0.001F, 0.0F}));
  for (const Vector3d& direction : {Vector3d(0, 0, 1),
                                    Vector3d(0.6, 0.3, 0.7),
                                    Vector3d(-0.5, 0.4, 0.6),
                                    Vector3d(0.1, -0.8, 0.5)}) {
    const Vector3d eye = 60 * direction.normalized();
    EyeView view = view_from(eye, true);
    const auto shells = draw_from_eye(scene, *material, view);
    ASSERT_TRUE(shells) << shells.error().what;
    view.shells = false;
    const auto plain = draw_from_eye(scene, *material, view);
    ASSERT_TRUE(plain) << plain.error().what;
    const auto surface = draw_from_eye(scene, *flat, view);
    ASSERT_TRUE(surface) << surface.error().what;
    const double beyond = heights[0] * shells->texel->mean_m;
    const auto geometry = geometry_of_eye(scene, view, beyond);
    ASSERT_TRUE(geometry) << geometry.error().what;
    // Rays that meet the plate so far inside that they meet every shell.
    const double slope = direction.head<2>().norm() / direction.z();
    const double inside = 0.1 - heights[0] * shells->texel->mean_m * slope;
    const auto least = static_cast<float>(2e-3 * brightest(*plain));
    int count = 0;
    int apart = 0;
    int apart_from_flat = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const Vector3d ray = geometry->world_from_projector.rotation *
                             Vector3d((x + 0.5 - geometry->cx) / geometry->fx,
                                      (y + 0.5 - geometry->cy) / geometry->fy,
                                      1);
        const Vector3d met = eye - eye.z() / ray.z() * ray;
        if (met.head<2>().cwiseAbs().maxCoeff() > inside) continue;
        ++count;
        const auto differ = [&](const EyePicture& a, const EyePicture& b) {
          return (a.radiance_xyz(x, y) - b.radiance_xyz(x, y)).cwiseAbs().maxCoeff() > least;
        };
        apart += differ(*plain, *shells) ? 1 : 0;
        apart_from_flat += differ(*surface, *shells) ? 1 : 0;
      }
    }
    ASSERT_GT(count, 1000);
    EXPECT_LE(apart, kMostAtBorders * count) << direction.transpose();
    // It is the parallax that makes them agree.
    if (slope > 0) {
      EXPECT_GT(apart_from_flat, 0.2 * count) << direction.transpose();
    }
  }
}

// Two plates behind each other: which triangle comes first in the mesh says nothing.
TEST(Shells, LieBehindEachOtherAsTheyAreMetNotAsTheyAreListed) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  Scene scene = scene_of("plate", {2, 2});
  const Mesh plate = scene.mesh;
  const auto count = static_cast<std::uint32_t>(plate.positions.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    scene.mesh.positions.emplace_back(plate.positions[i] + Vector3d(0.05, 0.03, -0.08));
    scene.mesh.normals.push_back(plate.normals[i]);
    scene.mesh.texture_coordinates.push_back(plate.texture_coordinates[i]);
  }
  for (const auto& [a, b, c] : plate.triangles)
    scene.mesh.triangles.push_back({a + count, b + count, c + count});
  // The upper plate's lowest layer is opaque, and beside it the other one's layers are seen.
  const auto material = material_of(random_stack({2.0F, 1.0F, 0.0F}));
  const EyeView view = view_from({0.4, -0.2, 0.8}, true);
  const auto one = draw_from_eye(scene, *material, view);
  ASSERT_TRUE(one) << one.error().what;
  std::ranges::reverse(scene.mesh.triangles);
  const auto other = draw_from_eye(scene, *material, view);
  ASSERT_TRUE(other) << other.error().what;
  EXPECT_LE(largest_difference(*one, *other), kRounding * brightest(*one));
  scene.mesh = plate;
  const auto alone = draw_from_eye(scene, *material, view);
  ASSERT_TRUE(alone) << alone.error().what;
  EXPECT_GT(largest_difference(*one, *alone), 1.0);
}

TEST(EyeViews, ArePicturesOfTheSameLightWhateverTheirSamples) {
  if (!has_gl()) GTEST_SKIP() << "no OpenGL";
  const Scene scene = scene_of("sphere", {6, 3});
  const ShaderMaterial white("return vec3(max(light.z, 0.0));");
  EyeView view = view_from({0, 0.1, 0.6}, false);
  const auto mean = [](const EyePicture& picture) {
    Vector3d sum = Vector3d::Zero();
    for (const Rgb32f& pixel : picture.radiance_xyz.pixels()) sum += pixel.cast<double>();
    return Vector3d(sum / static_cast<double>(picture.radiance_xyz.pixels().size()));
  };
  const auto coarse = draw_from_eye(scene, white, view);
  ASSERT_TRUE(coarse) << coarse.error().what;
  view.samples = 3;
  const auto fine = draw_from_eye(scene, white, view);
  ASSERT_TRUE(fine) << fine.error().what;
  EXPECT_EQ(fine->radiance_xyz.width(), view.width);
  EXPECT_NEAR((mean(*fine) - mean(*coarse)).norm() / mean(*coarse).norm(), 0.0, 2e-3);
  // Pixels at the contour are partly covered, and only those.
  const auto partly = [](const EyePicture& picture) {
    return std::ranges::count_if(picture.hidden.pixels(),
                                 [](float h) { return h > 0.0F && h < 1.0F; });
  };
  EXPECT_EQ(partly(*coarse), 0);
  EXPECT_GT(partly(*fine), 100);
  EXPECT_LT(partly(*fine), 2000);
}

TEST(EyeViews, AreRefusedWhereNothingCanBeSeen) {
  const Scene scene = scene_of("sphere", {6, 3});
  const ShaderMaterial plain("return vec3(0.5);");
  const auto refusal = [&](const EyeView& view, const btf::Material& material, const char* text) {
    const auto picture = draw_from_eye(scene, material, view);
    ASSERT_FALSE(picture);
    EXPECT_EQ(picture.error().code, Errc::kInvalidOption);
    EXPECT_NE(picture.error().what.find(text), std::string::npos) << picture.error().what;
  };
  refusal(view_from({0, 0, 1}, true), plain, "fit the model layered");
  refusal(view_from({0, 0, 0.1}, false), plain, "move the eye further away");
  refusal(view_from({0, std::nan(""), 1}, false), plain, "no number");
  for (const int samples : {0, EyeView::kMostSamples + 1}) {
    EyeView view = view_from({0, 0, 1}, false);
    view.samples = samples;
    refusal(view, plain, "1 to 8");
  }
  for (const int width : {0, EyeView::kMostPixels / 2 + 1}) {
    EyeView view = view_from({0, 0, 1}, false);
    view.samples = 2;
    view.width = width;
    refusal(view, plain, "1 to 8192");
  }
  const auto high = material_of(random_stack({60.0F, 0.0F}));
  refusal(view_from({0, 0, 1}, true), *high, "raise texture_repeats");
}

}  // namespace
}  // namespace veneer::render
