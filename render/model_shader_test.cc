// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/mapped_material.h"
#include "btf/models/layered/layered.h"
#include "btf/texel_pyramid.h"
#include "render/compensate_pass.h"
#include "render/draw_pass.h"
#include "render/egl_context.h"
#include "render/internal_fitted_models.h"
#include "render/internal_glslang.h"
#include "render/model_textures.h"
#include "render/shell_pass.h"

// Every model of the registry: what its shader draws is what its evaluation in double precision
// says.

namespace veneer::render {
namespace {

using btf::Direction;
using Eigen::Vector3d;
using Eigen::Vector4f;

struct Query {
  int texel;
  Direction view;
  Direction light;
};

// Directions where interpolation has corners: the pole and beside it, grazing, the horizon and
// below it, both sides of the azimuths where charts meet, measured directions, and any.
Direction awkward_direction(Pcg32& random) {
  const double phi = 2 * std::numbers::pi * random.uniform();
  const double seam = std::numbers::pi / 4 * (random.next() % 8);
  const double aside = 1e-6 * (random.uniform() - 0.5);
  const auto at = [](double z, double azimuth) {
    const double radius = std::sqrt(1 - z * z);
    return Direction(radius * std::cos(azimuth), radius * std::sin(azimuth), z);
  };
  switch (random.next() % 8) {
    case 0:
      return at(1.0, 0.0);
    case 1:
      return at(1 - 1e-7, phi);
    case 2:
      return at(1e-4 * random.uniform(), phi);
    case 3:
      return at(0.0, phi);
    case 4:
      return at(-0.3 * random.uniform(), phi);
    case 5:
      return at(random.uniform(), seam + aside);
    case 6: {
      static const btf::DirectionSet kMeasured = btf::bonn_directions();
      return kMeasured[random.next() % kMeasured.size()];
    }
    default:
      return at(random.uniform(), phi);
  }
}

std::vector<Query> queries(int count) {
  Pcg32 random(5);
  std::vector<Query> all;
  for (int i = 0; i < count; ++i) {
    const auto texel = static_cast<int>(random.next() % (kTexels * kTexels));
    // What the GPU is given, so that rounding the directions themselves is no difference.
    const auto direction = [&] {
      return Direction(awkward_direction(random).cast<float>().cast<double>());
    };
    const Direction view = direction();
    all.push_back({texel, view, direction()});
  }
  return all;
}

constexpr int kColumns = 64;
constexpr int kRows = 64;

std::string probe_source(const btf::ModelShader& shader) {
  return "#version 450 core\n" + shader.source + R"(
layout(std430, binding = 2) readonly buffer Queries { vec4 queries[]; };
layout(location = 0) out vec4 result;
void main() {
  int i = 3 * (int(gl_FragCoord.y) * )" +
         std::to_string(kColumns) + R"( + int(gl_FragCoord.x));
  result = vec4(btf_radiance(queries[i].xy, queries[i + 1].xyz, queries[i + 2].xyz), 1.0);
}
)";
}

// Of a level of `side` x `side` texels.
Result<std::vector<Vector4f>> draw(const btf::ModelShader& shader,
                                   const std::vector<Query>& all,
                                   int side = kTexels) {
  VENEER_ASSIGN(const GlProgram program,
                link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                              {GL_FRAGMENT_SHADER, "the model", probe_source(shader)}}));
  VENEER_ASSIGN(const ModelTextures textures, ModelTextures::upload(shader));
  ModelTextures::assign_units(shader, program.id());
  std::vector<Vector4f> input;
  for (std::size_t i = 0; i < all.size(); ++i) {
    // In any repeat of the sample, those at negative coordinates too.
    const auto repeat = static_cast<float>(static_cast<int>(i % 5) - 2);
    const auto centre = [side](int texel) {
      return (static_cast<float>(texel) + 0.5F) / static_cast<float>(side);
    };
    const float u = centre(all[i].texel % side) + repeat;
    const float v = centre(all[i].texel / side) - repeat;
    input.emplace_back(u, v, 0.0F, 0.0F);
    for (const Direction& d : {all[i].view, all[i].light})
      input.emplace_back(
          static_cast<float>(d.x()), static_cast<float>(d.y()), static_cast<float>(d.z()), 0.0F);
  }
  const GlBuffer buffer = make_buffer(input.data(), input.size() * sizeof(Vector4f), 0);
  const GlTexture target = make_texture_2d(GL_RGBA32F, kColumns, kRows);
  const GlFramebuffer framebuffer = make_framebuffer();
  const GlVertexArray no_vertices = make_vertex_array();
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, target.id(), 0);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glViewport(0, 0, kColumns, kRows);
  glDisable(GL_DEPTH_TEST);
  glUseProgram(program.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, buffer.id());
  textures.bind();
  glBindVertexArray(no_vertices.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  std::vector<Vector4f> output(all.size());
  glReadPixels(0, 0, kColumns, kRows, GL_RGBA, GL_FLOAT, output.data());
  return output;
}

// Whether a ray of a layered model passes so near the border between two texels of a layer that
// float may take the other one. A shift is at most 20 times a height, which is at most 8 texels
// here; of numbers to 160 float keeps 1e-5, and a shift is three roundings.
constexpr double kBorder = 5e-5;  // texels
bool meets_border(const std::optional<btf::ShellLayers>& shells, const Query& query) {
  if (!shells) return false;
  const auto is_near = [](double rise, const Direction& d) {
    const double scale = rise / std::max(d.z(), btf::LayerStack::kLeastCosine);
    return std::ranges::any_of(std::array{scale * d.x(), scale * d.y()}, [](double shift) {
      const double place = shift + 0.5;
      return std::abs(place - std::round(place)) < kBorder;
    });
  };
  const std::vector<float>& heights = shells->heights;
  for (std::size_t layer = 0; layer < heights.size(); ++layer) {
    if (is_near(heights[layer], query.view)) return true;
    for (std::size_t above = 0; above < layer; ++above)
      if (is_near(double(heights[above]) - double(heights[layer]), query.light)) return true;
  }
  return false;
}
// Of 6 layers 21 rays count, along two axes: 21 x 2 x 2 kBorder = 0.4 % of evenly spread places.
constexpr double kMostAtBorders = 0.005;

// The evaluation reads the very half floats that the shader reads, so that storing them makes no
// difference. What is left, relative to the largest sample (1.3 here):
// - GPUs keep 8 bits of the place between two filtered texels (the GL's minimum and what hardware
//   has), so that a filtered value is off by up to 2^-9 of the difference of neighbours in each of
//   three dimensions;
// - the map from a direction to texture coordinates in float is off by up to 1e-6, and by 3e-4 near
//   the pole, where it takes a root of 1 - z: that, times 8 nodes, is 2e-3 of neighbours'
//   difference.
constexpr double kLargestDifference = 1.3 * 8e-3;
// Sums of numbers up to 2 in float, in one order or another.
constexpr float kFloatSums = 1e-5F;
// On average they cancel: a wrong formula does not.
constexpr double kMeanDifference = 1.3 * 4e-4;

TEST(ModelShaders, DrawWhatTheEvaluationSays) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const std::vector<Query> all = queries(kColumns * kRows);
  for (const Fitted& fit : fitted()) {
    SCOPED_TRACE(fit.name);
    const btf::ModelShader shader = fit.material->shader();
    const auto drawn = draw(shader, all);
    ASSERT_TRUE(drawn) << drawn.error().what;
    double sum = 0;
    double largest = 0;
    double brightest = 0;
    int at_borders = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (meets_border(shader.shells, all[i])) {
        ++at_borders;
        continue;
      }
      const Vector3d wanted = fit.material->radiance(all[i].texel, all[i].view, all[i].light);
      const Vector3d got = (*drawn)[i].head<3>().cast<double>();
      const double difference = (wanted - got).cwiseAbs().maxCoeff();
      ASSERT_LE(difference, kLargestDifference)
          << "texel " << all[i].texel << ", view " << all[i].view.transpose() << ", light "
          << all[i].light.transpose() << ": drawn " << got.transpose() << ", evaluated "
          << wanted.transpose();
      sum += difference;
      largest = std::max(largest, difference);
      brightest = std::max(brightest, wanted.maxCoeff());
    }
    RecordProperty(fit.name + " largest difference", std::to_string(largest));
    EXPECT_LE(at_borders, kMostAtBorders * static_cast<double>(all.size()));
    EXPECT_LE(sum / static_cast<double>(all.size()), kMeanDifference);
    EXPECT_GT(brightest, 0.3) << "nothing was drawn";
  }
}

// Weight 1 is what everything else tests; 0 leaves the diffuse part; between them the shader is
// linear, except where it cuts negative sums to 0.
TEST(ModelShaders, FadeTheirSpecularTerm) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const std::vector<Query> all = queries(kColumns * kRows);
  int with_term = 0;
  for (const Fitted& fit : fitted()) {
    SCOPED_TRACE(fit.name);
    btf::ModelShader shader = fit.material->shader();
    const auto draw_at = [&](double weight) {
      btf::ModelShader weighted = shader;
      weighted.source = fmt::format("#define SPECULAR_WEIGHT {:.9f}\n", weight) + shader.source;
      auto drawn = draw(weighted, all);
      EXPECT_TRUE(drawn) << drawn.error().what;
      return drawn ? *drawn : std::vector<Vector4f>(all.size());
    };
    const std::vector<Vector4f> none = draw_at(0.0);
    const std::vector<Vector4f> half = draw_at(0.5);
    const std::vector<Vector4f> whole = draw_at(1.0);
    double faded = 0;
    double off_diffuse = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (meets_border(shader.shells, all[i])) continue;
      const Vector3d diffuse =
          fit.material->diffuse_radiance(all[i].texel, all[i].view, all[i].light);
      const double off = (diffuse - none[i].head<3>().cast<double>()).cwiseAbs().maxCoeff();
      ASSERT_LE(off, kLargestDifference) << all[i].view.transpose();
      off_diffuse += off;
      faded += double((whole[i] - none[i]).cwiseAbs().maxCoeff());
      for (int c = 0; c < 3; ++c) {
        if (!(none[i][c] > 0.0F && whole[i][c] > 0.0F)) continue;
        ASSERT_NEAR(half[i][c], (none[i][c] + whole[i][c]) / 2, kFloatSums);
      }
    }
    EXPECT_LE(off_diffuse / static_cast<double>(all.size()), kMeanDifference);
    if (fit.material->has_specular_term()) {
      ++with_term;
      EXPECT_GT(faded / static_cast<double>(all.size()), 10 * kMeanDifference);
    } else {
      EXPECT_EQ(faded, 0.0);
    }
  }
  EXPECT_GE(with_term, 5);
}

TEST(ModelShaders, DrawTheMipLevelThatIsSet) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const auto fit = std::ranges::find(fitted(), kWithMipLevels, &Fitted::name);
  ASSERT_NE(fit, fitted().end());
  const btf::TexelPyramid pyramid(kTexels, kTexels, kMipLevels);
  for (int level = 0; level < kMipLevels; ++level) {
    const int side = pyramid.width(level);
    std::vector<Query> all = queries(kColumns * kRows);
    for (Query& query : all) query.texel %= side * side;
    btf::ModelShader shader = fit->material->shader();
    const std::string start = "int texel_level = 0;";
    const std::size_t at = shader.source.find(start);
    ASSERT_NE(at, std::string::npos);
    shader.source.replace(at, start.size(), fmt::format("int texel_level = {};", level));
    const auto drawn = draw(shader, all, side);
    ASSERT_TRUE(drawn) << drawn.error().what;
    double sum = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Vector3d wanted =
          fit->material->radiance(pyramid.first(level) + all[i].texel, all[i].view, all[i].light);
      const double difference =
          (wanted - (*drawn)[i].head<3>().cast<double>()).cwiseAbs().maxCoeff();
      ASSERT_LE(difference, kLargestDifference) << "level " << level << ", texel " << all[i].texel;
      sum += difference;
    }
    EXPECT_LE(sum / static_cast<double>(all.size()), kMeanDifference);
  }
}

// Of a map larger than the sample, and of layers, whose rays move on the map.
TEST(ModelShaders, DrawAMapLargerThanItsSample) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  constexpr int kSide = 13;
  std::vector<Query> all = queries(kColumns * kRows);
  Pcg32 random(4);
  for (Query& query : all) query.texel = static_cast<int>(random.next() % (kSide * kSide));
  const auto other_texels = [&](std::unique_ptr<btf::Material> sample) {
    const auto mapped = btf::with_texel_map(std::move(sample), random_map(kSide, 6));
    EXPECT_TRUE(mapped) << mapped.error().what;
    const btf::ModelShader shader = (*mapped)->shader();
    const auto drawn = draw(shader, all, kSide);
    EXPECT_TRUE(drawn) << drawn.error().what;
    std::size_t others = 0;
    double brightest = 0;
    for (std::size_t i = 0; drawn && i < all.size(); ++i) {
      if (meets_border(shader.shells, all[i])) continue;
      const Vector3d wanted = (*mapped)->radiance(all[i].texel, all[i].view, all[i].light);
      if ((wanted - (*drawn)[i].head<3>().cast<double>()).cwiseAbs().maxCoeff() >
          kLargestDifference)
        ++others;
      brightest = std::max(brightest, wanted.maxCoeff());
    }
    EXPECT_GT(brightest, 0.3) << "nothing was drawn";
    return others;
  };
  const TemporaryFolder folder;
  const auto set = make_samples(folder.path() / "analytic.btfset");
  ASSERT_TRUE(set) << set.error().what;
  SilentProgress progress;
  auto sample = (*btf::find_model("revised-lpca"))->fit(*set, quick_options("3"), progress);
  ASSERT_TRUE(sample) << sample.error().what;
  EXPECT_EQ(other_texels(std::move(*sample)), 0U);
  btf::MaterialFrame frame{kTexels, kTexels, btf::bonn_directions(), btf::bonn_directions()};
  EXPECT_EQ(other_texels(btf::layered_material(std::move(frame), random_stack(3, random))), 0U);
}

TEST(ModelShaders, AreBlackBelowTheHorizonOfTheLight) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  std::vector<Query> all = queries(kColumns * kRows);
  for (Query& query : all) query.light.z() = -std::abs(query.light.z()) - 1e-3;
  for (const Fitted& fit : fitted()) {
    SCOPED_TRACE(fit.name);
    const auto drawn = draw(fit.material->shader(), all);
    ASSERT_TRUE(drawn) << drawn.error().what;
    for (const Vector4f& pixel : *drawn) ASSERT_EQ(pixel.head<3>(), Eigen::Vector3f::Zero());
  }
}

TEST(ModelShaders, AreValidByTheReferenceCompiler) {
  if (!has_glslang()) GTEST_SKIP() << "glslangValidator absent: install glslang-tools";
  for (const Fitted& fit : fitted()) {
    const btf::ModelShader shader = fit.material->shader();
    EXPECT_EQ(glslang_complaints(draw_fragment_source(shader.source, 2), "frag"), "") << fit.name;
    if (!shader.shells) continue;
    EXPECT_EQ(glslang_complaints(shell_fragment_source(shader, 2), "frag"), "") << fit.name;
  }
}

TEST(ModelShaders, StateTheirFetchesAndBytes) {
  for (const Fitted& fit : fitted()) {
    EXPECT_GT(fit.material->shader().fetches, 0) << fit.name;
    EXPECT_GT(fit.material->shader().gpu_bytes(), 0U) << fit.name;
  }
}

}  // namespace
}  // namespace veneer::render
