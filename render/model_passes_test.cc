// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>
#include <vector>

#include "render/draw_pass.h"
#include "render/egl_context.h"
#include "render/internal_fitted_models.h"
#include "render/internal_glslang.h"
#include "render/internal_testing.h"

// Every model of the registry: whichever pass evaluates its shader, the frame is the same.
namespace veneer::render {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4f;

constexpr std::array kWeights{1.0, 0.25};

/// A sphere under a sun and a lamp, seen from the side, and what it is drawn into.
class Stage {
 public:
  Stage(int width, int height, GLenum format)
      : width_(width),
        height_(height),
        profile_(example_profile(width, height, 8)),
        target_(make_texture_2d(format, width, height)),
        depth_(make_texture_2d(GL_DEPTH_COMPONENT32F, width, height)) {
    glNamedFramebufferTexture(framebuffer_.id(), GL_COLOR_ATTACHMENT0, target_.id(), 0);
    glNamedFramebufferTexture(framebuffer_.id(), GL_DEPTH_ATTACHMENT, depth_.id(), 0);
  }

  [[nodiscard]] const MeshBuffers& mesh() const { return mesh_; }
  [[nodiscard]] Result<DrawPass> pass(const btf::ModelShader& shader,
                                      const DrawOptions& options) const {
    return DrawPass::create(shader, lights_, {5, 5}, profile_, options);
  }
  /// Over what is no frame of any material.
  [[nodiscard]] std::vector<Vector4f> draw(const DrawPass& pass, double specular_weight) const {
    DrawInput input;
    input.eye_in_world = {-0.3, 0.2, 0.9};
    input.specular_weight = specular_weight;
    glClearNamedFramebufferfv(framebuffer_.id(), GL_COLOR, 0, Vector4f::Ones().eval().data());
    pass.draw(framebuffer_.id(), mesh_, input);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
    std::vector<Vector4f> pixels(static_cast<std::size_t>(width_) *
                                 static_cast<std::size_t>(height_));
    glReadPixels(0, 0, width_, height_, GL_RGBA, GL_FLOAT, pixels.data());
    return pixels;
  }

 private:
  int width_;
  int height_;
  calibration::ProjectorProfile profile_;
  std::vector<Light> lights_{
      DirectionalLight{Vector3d(0.3, 0.4, 0.85).normalized(), Vector3d::Constant(std::numbers::pi)},
      PointLight{{0.3, -0.2, 0.6}, Vector3d(0.5, 0.9, 1.2)}};
  MeshBuffers mesh_{*load_mesh("sphere")};
  GlTexture target_;
  GlTexture depth_;
  GlFramebuffer framebuffer_ = make_framebuffer();
};

// What the angular cache draws of a model is what its shader draws, to the interpolation between
// nodes that stand closer than the measured directions: on average the difference is small beside
// the sample's 0.2 to 1.3, while a wrong cluster or component would show everywhere.
constexpr double kMeanCacheDifference = 4e-3;

TEST(ModelShaders, CachedDrawsFollowThePerPixelDraw) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const Stage stage(320, 240, GL_RGBA32F);
  int tested = 0;
  for (const Fitted& fit : fitted()) {
    const btf::ModelShader shader = fit.material->shader();
    if (!shader.cache) continue;
    SCOPED_TRACE(fit.name);
    ++tested;
    std::vector<std::vector<Vector4f>> drawn;
    for (const AngularCacheOptions& cache :
         {AngularCacheOptions{}, AngularCacheOptions{.spacing = 4, .most_turn = 0.2}}) {
      const auto pass =
          stage.pass(shader, {.cache = cache, .filter = texel_filter(*fit.material, false)});
      ASSERT_TRUE(pass) << pass.error().what;
      for (const double weight : kWeights) drawn.push_back(stage.draw(*pass, weight));
      if (cache.spacing > 0) {
        ASSERT_NE(pass->cache(), nullptr);
        EXPECT_GT(stage.mesh().served(), 0.01);
      }
    }
    for (std::size_t w = 0; w < kWeights.size(); ++w) {
      const std::vector<Vector4f>& alone = drawn[w];
      const std::vector<Vector4f>& cached = drawn[kWeights.size() + w];
      double sum = 0;
      double brightness = 0;
      int covered = 0;
      for (std::size_t i = 0; i < alone.size(); ++i) {
        ASSERT_EQ(alone[i][3], cached[i][3]);
        if (!(alone[i][3] > 0.0F)) continue;
        ++covered;
        sum += double((alone[i] - cached[i]).head<3>().cwiseAbs().maxCoeff());
        brightness += double(alone[i].head<3>().maxCoeff());
      }
      ASSERT_GT(covered, 1000);
      EXPECT_GT(brightness / covered, 0.1);
      EXPECT_LT(sum / covered, kMeanCacheDifference) << "specular weight " << kWeights[w];
      EXPECT_GT(sum, 0.0) << "the cache was not used";
    }
    if (has_glslang()) {
      EXPECT_EQ(glslang_complaints(draw_cached_fragment_source(shader, 2, 16), "frag"), "");
      EXPECT_EQ(glslang_complaints(cache_values_compute_source(shader), "comp"), "");
    }
  }
  EXPECT_GE(tested, 3);
}

// Evaluated in a compute pass a material shows what it shows in the fragment stage, to what storing
// directions in 32 bits moves (5e-5 radians, on slopes of up to 20 times the sample's 1.3 per
// radian) and to half floats. Where a pixel sees a texel's edge either may be read: few do.
constexpr double kMostComputeDifference = 4e-3;
constexpr double kMeanComputeDifference = 2e-4;

TEST(ModelShaders, AreTheSameInAComputePass) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const Stage stage(170, 121, GL_RGBA16F);  // no whole groups
  for (const Fitted& fit : fitted()) {
    SCOPED_TRACE(fit.name);
    const btf::ModelShader shader = fit.material->shader();
    std::vector<std::vector<Vector4f>> drawn;
    for (const Evaluation evaluation : {Evaluation::kFragment, Evaluation::kCompute}) {
      const auto pass =
          stage.pass(shader,
                     {.filter = texel_filter(*fit.material, fit.name == kWithMipLevels),
                      .evaluation = evaluation});
      ASSERT_TRUE(pass) << pass.error().what;
      for (const double weight : kWeights) drawn.push_back(stage.draw(*pass, weight));
    }
    for (std::size_t w = 0; w < kWeights.size(); ++w) {
      SCOPED_TRACE(fmt::format("specular weight {}", kWeights[w]));
      double sum = 0;
      int covered = 0;
      int apart = 0;
      for (std::size_t i = 0; i < drawn[w].size(); ++i) {
        const Vector4f& fragment = drawn[w][i];
        const Vector4f& compute = drawn[kWeights.size() + w][i];
        // Seen from so flat that a side may count as turned away.
        if (std::max(fragment[3], compute[3]) < 1e-2F && fragment[3] != compute[3]) continue;
        const double difference = double((fragment - compute).cwiseAbs().maxCoeff());
        if (difference > kMostComputeDifference) {
          ++apart;
          continue;
        }
        sum += difference;
        covered += fragment[3] > 0.0F ? 1 : 0;
      }
      ASSERT_GT(covered, 1000);
      EXPECT_LE(apart, covered / 500);
      EXPECT_LE(sum / covered, kMeanComputeDifference);
    }
    EXPECT_EQ(drawn[2] != drawn[3], fit.material->has_specular_term());
    if (has_glslang()) {
      EXPECT_EQ(glslang_complaints(draw_compute_source(shader.source, 2), "comp"), "");
    }
  }
}

}  // namespace
}  // namespace veneer::render
