// SPDX-License-Identifier: Apache-2.0
#include "quality/screen_reference.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"
#include "render/internal_testing.h"
#include "render/screen_probe.h"

namespace veneer::quality {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using render::DirectionalLight;
using render::PointLight;

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr double kPi = std::numbers::pi;

using Albedo = std::function<Vector3d(int x, int y)>;

// What a sheet of matt texels sends, exactly: measured from one view and under one light, along the
// normal, the set's light follows the cosine and its view changes nothing.
btf::InterpolatedSet matt_set(int width, int height, const Albedo& albedo) {
  const TemporaryFolder folder;
  btf::SampleSetInfo info;
  info.width = width;
  info.height = height;
  info.views = {btf::Direction::UnitZ()};
  info.lights = {btf::Direction::UnitZ()};
  info.source = "a formula";
  auto writer = btf::SampleSetWriter::create(folder.path() / "matt.btfset", info);
  if (!writer) throw std::runtime_error(writer.error().what);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        writer->texel(y * width + x)[static_cast<std::size_t>(c)] = Eigen::half(albedo(x, y)[c]);
  if (const auto status = writer->finish(); !status) throw std::runtime_error(status.error().what);
  auto set = btf::SampleSet::open(folder.path() / "matt.btfset");
  if (!set) throw std::runtime_error(set.error().what);
  return btf::InterpolatedSet(*set);  // mapped; the file may go
}

// All of these are half floats.
Vector3d stripes(int x, int y) {
  return {0.25 + 0.125 * x, 0.75 - 0.125 * y, 0.5 - 0.0625 * x + 0.0625 * y};
}
constexpr int kStripesX = 4;
constexpr int kStripesY = 3;
constexpr char kStripesShader[] =
    "vec2 t = floor(fract(uv) * vec2(4.0, 3.0));"
    "return vec3(0.25 + 0.125 * t.x, 0.75 - 0.125 * t.y, 0.5 - 0.0625 * t.x + 0.0625 * t.y)"
    " * max(light.z, 0.0);";

render::Scene scene_of(const char* mesh) {
  render::Scene scene;
  scene.mesh = *load_mesh(mesh);
  scene.lights = {
      DirectionalLight{Vector3d(0.3, 0.5, 0.8).normalized(), Vector3d(60, 50, 40)},
      PointLight{{-0.5, 0.2, 0.6}, Vector3d(8, 9, 12)},
  };
  return scene;
}

std::vector<Viewpoint> two_viewpoints() {
  Viewpoint tilted;
  tilted.eye_in_world = {-0.4, 0.3, 0.9};
  tilted.world_from_object.rotation = Eigen::AngleAxisd(0.3, Vector3d::UnitX()) *
                                      Eigen::AngleAxisd(-0.4, Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(0.2, Vector3d::UnitZ());
  tilted.world_from_object.translation = {0.02, -0.03, 0.05};
  return {{{0.1, 0.1, 1.0}, {}}, tilted};
}

// No darkness that it cannot show.
calibration::ProjectorProfile profile_of(int bits) {
  calibration::ProjectorProfile profile = render::example_profile(kWidth, kHeight, bits);
  profile.black = profile.ambient = Xyz::Zero();
  return profile;
}

class ScreenReferenceTest : public ::testing::Test {
 protected:
  static ScreenReference make(const render::Scene& scene,
                              const calibration::ProjectorProfile& profile,
                              const btf::InterpolatedSet& set,
                              const ScreenReferenceOptions& options,
                              std::vector<Viewpoint> viewpoints = two_viewpoints()) {
    SilentProgress progress;
    auto reference =
        ScreenReference::make(scene, profile, set, std::move(viewpoints), options, progress);
    if (!reference) throw std::runtime_error(reference.error().what);
    return std::move(*reference);
  }
  static ScreenErrors measure(const ScreenReference& reference,
                              const render::Scene& scene,
                              const calibration::ProjectorProfile& profile,
                              const btf::Material& material) {
    const auto errors = measure_on_screen(reference, scene, profile, {&material, {}});
    if (!errors) throw std::runtime_error(errors.error().what);
    return *errors;
  }
  static std::vector<ScreenReference::Frame> wanted_frames(const ScreenReference& reference) {
    std::vector<ScreenReference::Frame> frames;
    for (std::size_t v = 0; v < reference.viewpoints().size(); ++v) {
      const std::vector<Xyz> wanted(reference.wanted(v).begin(), reference.wanted(v).end());
      frames.push_back({wanted, wanted});
    }
    return frames;
  }

  void SetUp() override {
    if (const auto context = render::probe_scene(scene_of("plate"), profile_of(8), {}, {});
        !context && context.error().code == Errc::kUnavailable)
      GTEST_SKIP() << context.error().what;
  }
};

TEST_F(ScreenReferenceTest, AnExactMaterialErrsByHalfFloatsAndCodesAlone) {
  render::Scene scene = scene_of("plate");
  scene.texture_repeats = {2, 2};
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const render::ShaderMaterial material(kStripesShader, kStripesX, kStripesY);
  // A half float is off by up to 2^-11, or 2^-10 where it is cut; encoded that is divided by 2.2,
  // and XYZ to RGB widens it about fourfold.
  constexpr double kHalfFloats = 4 * 0x1p-10 / 2.2;
  double coarser = 0;
  for (const int bits : {8, 12}) {
    const calibration::ProjectorProfile profile = profile_of(bits);
    const ScreenReference reference = make(scene, profile, set, {.pixels = 500, .rays = 1});
    const ScreenErrors errors = measure(reference, scene, profile, material);
    EXPECT_GT(errors.target.pixels, 400);
    EXPECT_EQ(errors.target.pixels, reference.counts().compared);
    EXPECT_LT(errors.target.rmse, kHalfFloats);
    EXPECT_LT(errors.target.de00_max, 0.3);
    RecordProperty("target de00_max", std::to_string(errors.target.de00_max));
    RecordProperty("received de00_mean", std::to_string(errors.received.de00_mean));
    if (bits == 8) {
      coarser = errors.received.de00_mean;
      EXPECT_LT(errors.received.de00_max, 1.0);
    } else {
      // Codes that are 16 times as fine leave what half floats err.
      EXPECT_LT(errors.received.de00_mean, coarser);
      EXPECT_LT(errors.received.de00_max, 0.3);
    }
  }
}

TEST_F(ScreenReferenceTest, ASmallerRasterCostsDetailAndNothingElse) {
  const calibration::ProjectorProfile profile = profile_of(12);
  render::Scene scene = scene_of("plate");
  const auto at_half = [&](const btf::InterpolatedSet& set, const btf::Material& material) {
    const ScreenReference reference = make(scene, profile, set, {.pixels = 500, .rays = 4});
    const auto errors = measure_on_screen(reference, scene, profile, {&material, {.scale = 0.5}});
    if (!errors) throw std::runtime_error(errors.error().what);
    return *errors;
  };
  const btf::InterpolatedSet even =
      matt_set(1, 1, [](int, int) { return Vector3d(0.5, 0.25, 0.125); });
  const render::ShaderMaterial even_material("return vec3(0.5, 0.25, 0.125) * max(light.z, 0.0);");
  const ScreenErrors smooth = at_half(even, even_material);
  EXPECT_LT(smooth.target.de00_max, 0.3);  // light and G change little from pixel to pixel
  EXPECT_LT(smooth.received.de00_max, 0.3);
  scene.texture_repeats = {6, 6};  // texels of two pixels, one of the smaller raster's
  const ScreenErrors detailed =
      at_half(matt_set(kStripesX, kStripesY, stripes),
              render::ShaderMaterial(kStripesShader, kStripesX, kStripesY));
  EXPECT_GT(detailed.target.de00_mean, 10 * smooth.target.de00_mean);
}

TEST_F(ScreenReferenceTest, DitherOfSeveralSeedsIsNoError) {
  const render::Scene scene = scene_of("plate");
  const btf::InterpolatedSet set =
      matt_set(1, 1, [](int, int) { return Vector3d(0.5, 0.25, 0.125); });
  const render::ShaderMaterial material("return vec3(0.5, 0.25, 0.125) * max(light.z, 0.0);");
  const calibration::ProjectorProfile profile = profile_of(6);
  const ScreenReference reference = make(scene, profile, set, {.pixels = 500, .rays = 2});
  const auto renderer = render::Renderer::create(scene, render::one_level(material), profile, {});
  ASSERT_TRUE(renderer) << renderer.error().what;
  Image<Rgb32f> target(kWidth, kHeight);
  std::vector<ScreenReference::Frame> once;
  std::vector<ScreenReference::Frame> often;
  for (std::size_t v = 0; v < reference.viewpoints().size(); ++v) {
    const Viewpoint& from = reference.viewpoints()[v];
    std::vector<Image<Rgb16>> codes;
    for (std::uint32_t seed = 0; seed < 32; ++seed) {
      (*renderer)->draw({from.eye_in_world, from.world_from_object, seed});
      codes.emplace_back(kWidth, kHeight);
      (*renderer)->read_codes(codes.back().view());
    }
    (*renderer)->read_target(target.view());
    once.push_back(reference.frame(v, target, std::span(codes).first(1)));
    often.push_back(reference.frame(v, target, codes));
  }
  const double noisy = reference.errors(once).received.de00_mean;
  const double still = reference.errors(often).received.de00_mean;
  EXPECT_GT(noisy, 1.0);  // six bits are seen
  // A golden-ratio sequence of 32 is within 0.1 of its mean, one threshold off by 0.4.
  EXPECT_LT(still, noisy / 8);
}

TEST_F(ScreenReferenceTest, MeetsItselfWithoutError) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const ScreenReference reference = make(scene_of("vase"), profile_of(8), set, {.pixels = 300});
  const ScreenErrors errors = reference.errors(wanted_frames(reference));
  for (const ScreenError& error : {errors.target, errors.received}) {
    EXPECT_EQ(error.pixels, reference.counts().compared);
    EXPECT_GT(error.pixels, 100);
    EXPECT_EQ(error.epsilon, 0.0);
    EXPECT_EQ(error.rmse, 0.0);
    EXPECT_EQ(error.de00_max, 0.0);
  }
}

TEST_F(ScreenReferenceTest, ADarkerPictureIsOffByWhatItIsDarker) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const calibration::ProjectorProfile profile = profile_of(8);
  const ScreenReference reference = make(scene_of("plate"), profile, set, {.pixels = 300});
  std::vector<ScreenReference::Frame> frames = wanted_frames(reference);
  constexpr double kShare = 0.9;
  double encoded = 0;
  double lightness = 0;
  for (ScreenReference::Frame& frame : frames)
    for (Xyz& xyz : frame.target) {
      for (int c = 0; c < 3; ++c)
        encoded += std::pow((srgb_from_xyz() * xyz)[c] / profile.white().y(), 1 / 2.2);
      const Lab before = lab_from_xyz(xyz, profile.white());
      xyz *= kShare;
      lightness += delta_e_2000(lab_from_xyz(xyz, profile.white()), before);
    }
  const ScreenErrors errors = reference.errors(frames);
  const auto pixels = static_cast<double>(reference.counts().compared);
  constexpr double kRounding = 1e-12;
  EXPECT_NEAR(
      errors.target.epsilon, encoded / (3 * pixels) * (1 - std::pow(kShare, 1 / 2.2)), kRounding);
  EXPECT_NEAR(errors.target.de00_mean, lightness / pixels, 1e-9);
  EXPECT_LE(errors.target.de00_p95, errors.target.de00_max);
  EXPECT_GE(errors.target.rmse, errors.target.epsilon);
  EXPECT_EQ(errors.received.de00_max, 0.0);
}

TEST_F(ScreenReferenceTest, AValueThatIsNoNumberSpoilsEveryFigure) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const ScreenReference reference = make(scene_of("plate"), profile_of(8), set, {.pixels = 100});
  std::vector<ScreenReference::Frame> frames = wanted_frames(reference);
  frames[1].target[7].y() = std::numeric_limits<double>::quiet_NaN();
  const ScreenErrors errors = reference.errors(frames);
  EXPECT_TRUE(std::isnan(errors.target.epsilon));
  EXPECT_TRUE(std::isnan(errors.target.rmse));
  EXPECT_TRUE(std::isnan(errors.target.de00_mean));
  EXPECT_TRUE(std::isnan(errors.target.de00_p95));
  EXPECT_TRUE(std::isnan(errors.target.de00_max));
  EXPECT_EQ(errors.received.de00_max, 0.0);
}

TEST_F(ScreenReferenceTest, LightsAddUpAndTwiceTheLightAsksForTwiceAsMuch) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const calibration::ProjectorProfile profile = profile_of(8);
  const ScreenReferenceOptions options{.pixels = 200, .rays = 3};
  render::Scene scene = scene_of("vase");
  const ScreenReference both = make(scene, profile, set, options);
  const std::vector<render::Light> lights = scene.lights;
  scene.lights = {lights[0]};
  const ScreenReference first = make(scene, profile, set, options);
  scene.lights = {lights[1]};
  const ScreenReference second = make(scene, profile, set, options);
  scene.lights = {lights[1], lights[0], lights[1], lights[0]};
  const ScreenReference twice = make(scene, profile, set, options);
  // Of directions that single precision gives, which the compiler of the shader may round
  // otherwise.
  constexpr double kRounding = 2e-6;
  for (std::size_t v = 0; v < 2; ++v) {
    ASSERT_EQ(both.wanted(v).size(), first.wanted(v).size());
    for (std::size_t i = 0; i < both.wanted(v).size(); ++i) {
      const Xyz& wanted = both.wanted(v)[i];
      EXPECT_LT((first.wanted(v)[i] + second.wanted(v)[i] - wanted).norm(),
                kRounding * wanted.norm());
      EXPECT_LT((twice.wanted(v)[i] - 2 * wanted).norm(), kRounding * wanted.norm());
    }
  }
}

TEST_F(ScreenReferenceTest, APointLightFarAwayIsADirectionalOne) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const calibration::ProjectorProfile profile = profile_of(8);
  const Vector3d direction = Vector3d(0.3, -0.2, 0.6).normalized();
  const Vector3d illuminance(60, 50, 40);
  constexpr double kFar = 1000.0;  // metres; the vase is within a quarter of one
  render::Scene scene = scene_of("vase");
  scene.lights = {DirectionalLight{direction, illuminance}};
  const ScreenReference sun = make(scene, profile, set, {.pixels = 200});
  scene.lights = {PointLight{kFar * direction, kFar * kFar * illuminance}};
  const ScreenReference lamp = make(scene, profile, set, {.pixels = 200});
  const double tolerance = 3 * 0.25 / kFar * profile.white().norm();
  for (std::size_t v = 0; v < 2; ++v)
    for (std::size_t i = 0; i < sun.wanted(v).size(); ++i)
      EXPECT_LT((sun.wanted(v)[i] - lamp.wanted(v)[i]).norm(), tolerance);
}

TEST_F(ScreenReferenceTest, ACheckerboardFarAwayIsItsMean) {
  render::Scene scene = scene_of("plate");
  scene.lights = {DirectionalLight{Vector3d::UnitZ(), Vector3d::Constant(kPi)}};
  scene.texture_repeats = {201, 203};  // of two texels, on some 50 pixels
  const btf::InterpolatedSet checkers =
      matt_set(2, 2, [](int x, int y) { return Vector3d::Constant((x + y) % 2); });
  const calibration::ProjectorProfile profile = profile_of(8);
  const ScreenReference reference =
      make(scene, profile, checkers, {.pixels = 300, .rays = 32}, {{{0, 0, 1}, {}}});
  for (const Xyz& wanted : reference.wanted(0))
    EXPECT_NEAR(wanted.y(), 0.5, 0.05);  // eight texels along a side, and a part of one more
}

TEST_F(ScreenReferenceTest, AsksForWhatRaysCastByHandFindOnAPlate) {
  render::Scene scene = scene_of("plate");
  scene.texture_repeats = {3, 4};
  constexpr int kTexels = 16;
  Pcg32 random(11);
  std::vector<Vector3d> texels;
  for (int i = 0; i < kTexels * kTexels; ++i)
    texels.push_back(Vector3d(random.uniform(), random.uniform(), random.uniform())
                         .cast<Eigen::half>()
                         .cast<double>());
  const auto texel = [&](int x, int y) {
    return texels[static_cast<std::size_t>(y * kTexels + x)];
  };
  const btf::InterpolatedSet set = matt_set(kTexels, kTexels, texel);
  const calibration::ProjectorProfile profile = profile_of(8);
  const calibration::ProjectorGeometry& g = profile.geometry;
  const ScreenReference reference = make(scene, profile, set, {.pixels = 150, .rays = 32});
  double sum = 0;
  int values = 0;
  for (std::size_t v = 0; v < reference.viewpoints().size(); ++v) {
    const RigidTransform object_from_world = reference.viewpoints()[v].world_from_object.inverse();
    const RigidTransform object_from_projector = object_from_world * g.world_from_projector;
    const auto point_at = [&](double x, double y) -> Vector3d {
      const Vector3d along =
          object_from_projector.rotation * Vector3d((x - g.cx) / g.fx, (y - g.cy) / g.fy, 1.0);
      return object_from_projector.translation -
             along * (object_from_projector.translation.z() / along.z());
    };
    for (std::size_t i = 0; i < reference.pixels(v).size(); ++i) {
      const int pixel = reference.pixels(v)[i];
      const int left = pixel % kWidth;
      const int top = pixel / kWidth;
      constexpr int kRays = 48;
      Vector3d albedo = Vector3d::Zero();
      for (int b = 0; b < kRays; ++b)
        for (int a = 0; a < kRays; ++a) {
          const Vector3d point = point_at(left + (a + 0.5) / kRays, top + (b + 0.5) / kRays);
          const Vector2d uv(3 * (point.x() / 0.2 + 0.5), 4 * (0.5 - point.y() / 0.2));
          const auto index = [](double at) {
            return static_cast<int>((at - std::floor(at)) * kTexels);
          };
          albedo += texel(index(uv.x()), index(uv.y())) / (kRays * kRays);
        }
      const Vector3d centre = point_at(left + 0.5, top + 0.5);
      const auto& sun = std::get<DirectionalLight>(scene.lights[0]);
      const auto& lamp = std::get<PointLight>(scene.lights[1]);
      const Vector3d to_lamp = object_from_world * lamp.position - centre;
      const Vector3d light =
          std::max((object_from_world.rotation * sun.direction_to_light).z(), 0.0) / kPi *
              sun.illuminance_rgb +
          std::max(to_lamp.z(), 0.0) / std::pow(to_lamp.norm(), 3) / kPi * lamp.intensity_rgb;
      const Vector3d off = (srgb_from_xyz() * reference.wanted(v)[i]).cwiseQuotient(light) - albedo;
      // Borders cross a pixel's 32 rays along a side, and the pixel is taken for a parallelogram.
      EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.06) << "pixel " << left << ", " << top;
      sum += off.cwiseAbs().sum();
      values += 3;
    }
  }
  EXPECT_GT(values, 600);
  EXPECT_LT(sum / values, 0.008);
}

TEST_F(ScreenReferenceTest, CountsWhatIsLeftOutAndWhy) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  const render::Scene scene = scene_of("sphere");
  calibration::ProjectorProfile profile = profile_of(8);
  profile.vignetting = Image<float>(1, 2);  // hardly any light on the lower part
  profile.vignetting(0, 0) = 1.0F;
  profile.vignetting(0, 1) = 0.01F;
  // From the side: half of what the projector lights is turned away.
  const std::vector<render::FrameInput> inputs{{{2, 0, 0}, {}}};
  const ScreenReference reference =
      make(scene, profile, set, {.pixels = 10'000'000, .rays = 2}, {{{2, 0, 0}, {}}});
  const ScreenReference::Counts& counts = reference.counts();
  EXPECT_GT(counts.at_edges, 50);  // its silhouette, some 50 pixels across
  EXPECT_GT(counts.out_of_reach, 0);
  EXPECT_GT(counts.unseen, counts.compared / 2);
  EXPECT_EQ(counts.unsound, 0);
  EXPECT_EQ(counts.compared, static_cast<std::int64_t>(reference.pixels(0).size()));
  const auto screens = render::probe_scene(scene, profile, inputs, {});
  ASSERT_TRUE(screens) << screens.error().what;
  EXPECT_EQ(counts.compared + counts.at_edges + counts.out_of_reach + counts.unseen,
            screens->front().covered);
  for (const int pixel : reference.pixels(0))
    EXPECT_LT(pixel / kWidth, 0.75 * kHeight);  // where the fall-off ends
}

TEST_F(ScreenReferenceTest, SaysWhyNothingCanBeCompared) {
  const btf::InterpolatedSet set = matt_set(kStripesX, kStripesY, stripes);
  SilentProgress progress;
  std::vector<Viewpoint> away = two_viewpoints();
  away[1].world_from_object.translation = {50, 0, 0};
  const auto outside =
      ScreenReference::make(scene_of("plate"), profile_of(8), set, away, {}, progress);
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, Errc::kInvalidOption);
  EXPECT_NE(outside.error().what.find("where the projector lights it"), std::string::npos)
      << outside.error().what;
  EXPECT_FALSE(ScreenReference::make(scene_of("plate"), profile_of(8), set, {}, {}, progress));
}

TEST(ScreenReferenceOptions, RefuseWhatCannotBeCompared) {
  EXPECT_TRUE(ScreenReferenceOptions{}.check());
  EXPECT_FALSE(ScreenReferenceOptions{.pixels = 0}.check());
  EXPECT_FALSE(ScreenReferenceOptions{.pixels = 10'000'001}.check());
  EXPECT_FALSE(ScreenReferenceOptions{.rays = 0}.check());
  EXPECT_FALSE(ScreenReferenceOptions{.rays = 33}.check());
  for (const int seeds : {1, 64})
    EXPECT_TRUE(ScreenReferenceOptions{.dither_seeds = seeds}.check());
  for (const int seeds : {-1, 0, 65}) {
    const Status refused = ScreenReferenceOptions{.dither_seeds = seeds}.check();
    ASSERT_FALSE(refused) << seeds;
    EXPECT_NE(refused.error().what.find(fmt::format("{} dither seeds", seeds)), std::string::npos)
        << refused.error().what;
  }
}

}  // namespace
}  // namespace veneer::quality
