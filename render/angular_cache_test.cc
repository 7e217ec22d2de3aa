// SPDX-License-Identifier: Apache-2.0
#include "render/angular_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "render/compensation.h"
#include "render/draw_pass.h"
#include "render/egl_context.h"
#include "render/internal_glslang.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4f;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
// Half floats of the values, of their products and of the target.
constexpr double kHalfFloats = 3e-3;

const DirectionalLight kSun{Vector3d(0.3, 0.4, 0.85).normalized(),
                            Vector3d::Constant(std::numbers::pi)};
const PointLight kLamp{{0.2, -0.1, 0.5}, {0.6, 0.4, 0.3}};

class AngularCacheTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
    context_.emplace(std::move(*context));
    target_ = make_texture_2d(GL_RGBA32F, kWidth, kHeight);
    depth_ = make_texture_2d(GL_DEPTH_COMPONENT32F, kWidth, kHeight);
    framebuffer_ = make_framebuffer();
    glNamedFramebufferTexture(framebuffer_.id(), GL_COLOR_ATTACHMENT0, target_.id(), 0);
    glNamedFramebufferTexture(framebuffer_.id(), GL_DEPTH_ATTACHMENT, depth_.id(), 0);
  }

  struct Drawn {
    std::vector<Vector4f> pixels;
    double served = 0;  // of all triangles
  };

  Drawn draw(const Mesh& mesh,
             const std::vector<Light>& lights,
             const AngularCacheOptions& options) {
    const MeshBuffers buffers(mesh);
    const auto pass =
        DrawPass::create(smooth_model(), lights, {1, 1}, profile_, {.cache = options});
    EXPECT_TRUE(pass) << pass.error().what;
    Drawn drawn;
    drawn.pixels.resize(kWidth * kHeight);
    DrawInput input;
    input.eye_in_world = {-0.4, 0.3, 0.9};
    // Twice: nothing may be left over from the frame before.
    for (int i = 0; i < 2; ++i) pass->draw(framebuffer_.id(), buffers, input);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
    glReadPixels(0, 0, kWidth, kHeight, GL_RGBA, GL_FLOAT, drawn.pixels.data());
    if (pass->cache() != nullptr) drawn.served = buffers.served();
    return drawn;
  }

  static double largest_difference(const Drawn& a, const Drawn& b) {
    double largest = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
      // Both cover the same pixels.
      EXPECT_EQ(a.pixels[i][3], b.pixels[i][3]) << i % kWidth << ", " << i / kWidth;
      largest = std::max(largest, double((a.pixels[i] - b.pixels[i]).cwiseAbs().maxCoeff()));
    }
    return largest;
  }

  std::optional<EglContext> context_;
  GlTexture target_;
  GlTexture depth_;
  GlFramebuffer framebuffer_;
  calibration::ProjectorProfile profile_ = example_profile(kWidth, kHeight, 8);
};

// The error of linear interpolation of a function with bounded second derivative over a turn t: t^2
// / 8 along each of two sides, for values of slope 1/4 a direction (two directions, XYZ up to 1.1
// times RGB).
double interpolation_bound(double turn) { return 0.5 * turn * turn + kHalfFloats; }

TEST_F(AngularCacheTest, FollowsThePerPixelDrawWithinTheBoundOfInterpolation) {
  for (const char* name : {"plate", "sphere", "vase"}) {
    const Mesh mesh = *load_mesh(name);
    for (const std::vector<Light>& lights : {std::vector<Light>{kSun}, {kSun, kLamp}}) {
      const Drawn exact = draw(mesh, lights, {});
      const Drawn cached = draw(mesh, lights, {.spacing = 4, .most_turn = 0.2});
      const double bound = static_cast<double>(lights.size()) * 3.0 * interpolation_bound(0.2);
      EXPECT_LT(largest_difference(exact, cached), bound) << name;
      EXPECT_GT(cached.served, 0.01) << name << ": nothing was tested";
    }
  }
}

TEST_F(AngularCacheTest, DrawsPixelByPixelWhereDirectionsTurnTooFast) {
  const Mesh sphere = *load_mesh("sphere");
  const Drawn exact = draw(sphere, {kSun}, {});
  const Drawn none = draw(sphere, {kSun}, {.spacing = 4, .most_turn = 1e-6});
  EXPECT_EQ(none.served, 0.0);
  EXPECT_EQ(largest_difference(exact, none), 0.0);
  const Drawn wide = draw(sphere, {kSun}, {.spacing = 4, .most_turn = 0.3});
  const Drawn narrow = draw(sphere, {kSun}, {.spacing = 4, .most_turn = 0.15});
  EXPECT_GT(wide.served, narrow.served);
  EXPECT_GT(narrow.served, 0.0);
}

// A plate with a ridge that is narrower than a cell and lies between two columns of nodes.
TEST_F(AngularCacheTest, SeesWhatCurvesBetweenItsNodes) {
  Mesh ridge;
  constexpr std::uint32_t kColumns = 200;
  constexpr std::uint32_t kRows = 20;
  for (std::uint32_t j = 0; j <= kRows; ++j) {
    for (std::uint32_t i = 0; i <= kColumns; ++i) {
      const double u = static_cast<double>(i) / kColumns;
      const double v = static_cast<double>(j) / kRows;
      const bool steep = i == kColumns / 2;
      ridge.positions.emplace_back(0.2 * (u - 0.5), 0.2 * (0.5 - v), 0.0);
      ridge.normals.push_back(steep ? Vector3d(0.7, 0.0, 0.7).normalized() : Vector3d::UnitZ());
      ridge.texture_coordinates.emplace_back(u, v);
    }
  }
  for (std::uint32_t j = 0; j < kRows; ++j) {
    for (std::uint32_t i = 0; i < kColumns; ++i) {
      const std::uint32_t at = j * (kColumns + 1) + i;
      const std::uint32_t below = at + kColumns + 1;
      ridge.triangles.push_back({at, below, below + 1});
      ridge.triangles.push_back({at, below + 1, at + 1});
    }
  }
  const Drawn exact = draw(ridge, {kSun}, {});
  const Drawn cached = draw(ridge, {kSun}, {.spacing = 16, .most_turn = 0.1});
  EXPECT_LT(largest_difference(exact, cached), 3.0 * interpolation_bound(0.1));
  EXPECT_GT(cached.served, 0.02);
  EXPECT_LT(cached.served, 1.0 - 2.0 / kColumns + 1e-9);
}

TEST_F(AngularCacheTest, NodesLieAtTheCornersOfPixels) {
  const auto cache = AngularCache::create(smooth_model(), 1, {.spacing = 16}, kWidth, kHeight);
  ASSERT_TRUE(cache) << cache.error().what;
  const Eigen::Matrix4d m = cache->nodes_from_clip();
  constexpr int kColumns = kWidth / 16 + 1 + 2 * kCacheMargin;
  // Pixel corner X is the centre of node X / 16 + margin.
  for (const int x : {0, 16, 160, 320}) {
    const double ndc = 2.0 * x / kWidth - 1.0;
    const Eigen::Vector4d clip = m * Eigen::Vector4d(3.0 * ndc, 0.0, 1.0, 3.0);
    EXPECT_NEAR((clip.x() / clip.w() + 1.0) / 2.0 * kColumns, x / 16.0 + kCacheMargin + 0.5, 1e-12);
  }
}

TEST(AngularCacheOptions, AreChecked) {
  EXPECT_TRUE(AngularCacheOptions{}.check());
  EXPECT_TRUE((AngularCacheOptions{.spacing = 16}.check()));
  EXPECT_FALSE((AngularCacheOptions{.spacing = 3}.check()));
  EXPECT_FALSE((AngularCacheOptions{.spacing = 129}.check()));
  EXPECT_FALSE((AngularCacheOptions{.spacing = 16, .most_turn = 0.0}.check()));
  EXPECT_FALSE((AngularCacheOptions{.spacing = 16, .most_turn = NAN}.check()));
}

TEST(AngularCacheShaders, AreValidByTheReferenceCompiler) {
  if (!has_glslang()) GTEST_SKIP() << "glslangValidator absent: install glslang-tools";
  for (const int lights : {1, kMaxLights}) {
    EXPECT_EQ(glslang_complaints(cache_nodes_fragment_source(lights), "frag"), "");
    EXPECT_EQ(glslang_complaints(cache_cells_fragment_source(lights, 0.1), "frag"), "");
    EXPECT_EQ(glslang_complaints(cache_sort_compute_source(lights, {64, 48, 16}, 0.1), "comp"), "");
    EXPECT_EQ(glslang_complaints(draw_cached_fragment_source(smooth_model(), lights, 16), "frag"),
              "");
  }
  EXPECT_EQ(glslang_complaints(cache_values_compute_source(smooth_model()), "comp"), "");
}

}  // namespace
}  // namespace veneer::render
