// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "render/egl_context.h"
#include "render/fade_mask.h"
#include "render/internal_testing.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr int kWidth = 160;
constexpr int kHeight = 128;

// Counts how often it is packed for the GPU.
class CountedMaterial final : public ShaderMaterial {
 public:
  using ShaderMaterial::ShaderMaterial;
  [[nodiscard]] btf::ModelShader shader() const override {
    ++packed;
    return ShaderMaterial::shader();
  }
  mutable int packed = 0;
};

Scene plate_scene() {
  Scene scene;
  scene.mesh = *load_mesh("plate");
  scene.lights = {DirectionalLight{Vector3d(0.3, 0.5, 0.8).normalized(),
                                   Vector3d::Constant(20 * std::numbers::pi)}};
  return scene;
}

struct Picture {
  std::vector<Rgb32f> target;
  std::vector<Rgb16> codes;
  friend bool operator==(const Picture&, const Picture&) = default;
};

class RendererLevelsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }

  [[nodiscard]] Result<std::unique_ptr<Renderer>> make(const std::vector<Level>& levels) const {
    return Renderer::create(plate_scene(), levels, profile_, options_);
  }

  // The plate a little turned, so that nothing lies along rows, and near: it fills much of the
  // raster.
  static FrameInput frame(std::size_t level = 0, std::size_t next = 0, double fade = 0) {
    FrameInput input;
    input.eye_in_world = {-0.4, 0.3, 0.9};
    input.world_from_object.rotation =
        Eigen::AngleAxisd(-0.3, Vector3d::UnitY()) * Eigen::AngleAxisd(0.2, Vector3d::UnitZ());
    input.world_from_object.translation = {0.06, 0.12, 0.6};
    input.dither_seed = 7;
    input.level = level;
    input.next_level = next;
    input.fade = fade;
    return input;
  }

  static Picture picture(Renderer& renderer, const FrameInput& input) {
    renderer.draw(input);
    Image<Rgb32f> target(kWidth, kHeight);
    Image<Rgb16> codes(kWidth, kHeight);
    renderer.read_target(target.view());
    renderer.read_codes(codes.view());
    return {{target.pixels().begin(), target.pixels().end()},
            {codes.pixels().begin(), codes.pixels().end()}};
  }

  static std::size_t covered(const Picture& picture) {
    return static_cast<std::size_t>(std::ranges::count_if(
        picture.target, [](const Rgb32f& pixel) { return pixel != Rgb32f(0, 0, 0); }));
  }

  calibration::ProjectorProfile profile_ = example_profile(kWidth, kHeight, 8);
  RendererOptions options_{};
  ShaderMaterial warm_{std::string("return vec3(0.9, 0.5 + 0.3 * sin(40.0 * uv.x), 0.2);")};
  ShaderMaterial cold_{std::string("return vec3(0.2, 0.4, 0.5 + 0.4 * sin(50.0 * uv.y));")};
  ShaderMaterial smooth_{smooth_model()};
};

// Eight, in every way in which one may be drawn.
TEST_F(RendererLevelsTest, OneAmongSeveralDrawsWhatItDrawsAlone) {
  const std::vector<Level> levels{
      {&warm_, {}},
      {&cold_, {}},
      {&smooth_, {}},
      {&smooth_, {.cache = {.spacing = 8, .most_turn = 0.5}}},
      {&smooth_, {.evaluation = Evaluation::kCompute}},
      {&warm_, {.average_texels = true, .scale = 0.5}},
      {&smooth_, {.evaluation = Evaluation::kCompute, .scale = 0.5}},
      {&smooth_, {.cache = {.spacing = 8, .most_turn = 0.5}, .scale = 0.71}}};
  const auto several = make(levels);
  ASSERT_TRUE(several) << several.error().what;
  std::vector<Picture> alone;
  for (const Level& level : levels) {
    const auto one = make({level});
    ASSERT_TRUE(one) << one.error().what;
    alone.push_back(picture(**one, frame()));
    ASSERT_GT(covered(alone.back()), 1000U);
  }
  for (const std::size_t level : {0, 1, 2, 3, 4, 5, 6, 7, 0, 6, 1, 3}) {
    // Neither a fade of none nor one that is over shows anything of another.
    EXPECT_TRUE(picture(**several, frame(level, 0, 0)) == alone[level]) << level;
    EXPECT_TRUE(picture(**several, frame(1, level, 1)) == alone[level]) << level;
    EXPECT_TRUE(picture(**several, frame(level, level, 0.5)) == alone[level]) << level;
  }
}

TEST_F(RendererLevelsTest, PackTheirMaterialOnce) {
  const CountedMaterial counted(std::string("return vec3(0.5);"));
  const auto renderer = make({{&counted, {}},
                              {&warm_, {}},
                              {&counted, {.scale = 0.5}},
                              {&counted, {.evaluation = Evaluation::kCompute}}});
  ASSERT_TRUE(renderer) << renderer.error().what;
  EXPECT_EQ(counted.packed, 1);
}

// Every tile goes over once as the fade grows, at every pixel is shown what one of the two shows
// alone, and about as much of the picture has gone over as the fade says.
TEST_F(RendererLevelsTest, TilesGoOverOnceEach) {
  const DrawingOptions fragment{};
  const DrawingOptions compute{.evaluation = Evaluation::kCompute};
  const DrawingOptions cached{.cache = {.spacing = 8, .most_turn = 0.5}};
  const DrawingOptions half{.scale = 0.5};
  const DrawingOptions uneven{.scale = 0.71};
  const DrawingOptions least{.scale = DrawingOptions::kLeastScale};
  const DrawingOptions small_compute{.evaluation = Evaluation::kCompute, .scale = 0.5};
  const std::vector<std::pair<Level, Level>> pairs{{{&warm_, fragment}, {&cold_, fragment}},
                                                   {{&warm_, fragment}, {&cold_, compute}},
                                                   {{&warm_, compute}, {&cold_, compute}},
                                                   {{&warm_, fragment}, {&smooth_, cached}},
                                                   {{&warm_, fragment}, {&cold_, half}},
                                                   {{&warm_, uneven}, {&cold_, fragment}},
                                                   {{&warm_, least}, {&cold_, small_compute}}};
  constexpr int kSteps = 20;
  // Of the picture: the tiles are few here, and the plate's edge cuts some.
  constexpr double kEven = 0.06;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const auto renderer = make({pairs[p].first, pairs[p].second});
    ASSERT_TRUE(renderer) << renderer.error().what;
    const Picture before = picture(**renderer, frame(0));
    const Picture after = picture(**renderer, frame(1));
    std::vector<bool> gone(before.target.size(), false);
    for (int step = 1; step < kSteps; ++step) {
      const double fade = static_cast<double>(step) / kSteps;
      const Picture now = picture(**renderer, frame(0, 1, fade));
      std::size_t on_plate = 0;
      std::size_t gone_over = 0;
      std::set<std::pair<std::size_t, std::size_t>> kept;
      std::set<std::pair<std::size_t, std::size_t>> taken;
      for (std::size_t i = 0; i < now.target.size(); ++i) {
        const std::pair tile{i % kWidth / kFadeTile, i / kWidth / kFadeTile};
        if (before.target[i] == after.target[i]) {
          ASSERT_EQ(now.target[i], after.target[i]);
          continue;
        }
        const bool is_after = now.target[i] == after.target[i];
        ASSERT_TRUE(is_after || now.target[i] == before.target[i])
            << "pair " << p << ", fade " << fade << ", pixel " << i % kWidth << ", " << i / kWidth
            << ": " << now.target[i].transpose();
        ASSERT_EQ(now.codes[i], is_after ? after.codes[i] : before.codes[i]);
        ASSERT_TRUE(is_after || !gone[i]) << "pixel " << i << " came back at " << fade;
        gone[i] = is_after;
        (is_after ? taken : kept).insert(tile);
        ++on_plate;
        gone_over += is_after ? 1 : 0;
      }
      for (const auto& tile : taken) ASSERT_FALSE(kept.contains(tile)) << "pair " << p;
      ASSERT_GT(on_plate, 1000U);
      EXPECT_NEAR(static_cast<double>(gone_over) / static_cast<double>(on_plate), fade, kEven)
          << "pair " << p;
    }
  }
}

// Two levels on one smaller raster meet there, and the border between them is interpolated like
// everything else: each pixel lies between the two, and is one of them away from borders.
TEST_F(RendererLevelsTest, OnOneSmallerRasterTilesMeetSmoothly) {
  const auto renderer = make({{&warm_, {.scale = 0.5}}, {&cold_, {.scale = 0.5}}});
  ASSERT_TRUE(renderer) << renderer.error().what;
  const Picture before = picture(**renderer, frame(0));
  const Picture after = picture(**renderer, frame(1));
  const Picture now = picture(**renderer, frame(0, 1, 0.5));
  std::size_t of_one = 0;
  std::size_t between = 0;
  for (std::size_t i = 0; i < now.target.size(); ++i) {
    if (now.target[i] == before.target[i] || now.target[i] == after.target[i]) {
      ++of_one;
      continue;
    }
    ++between;
    const std::size_t x = i % kWidth % kFadeTile;
    const std::size_t y = i / kWidth % kFadeTile;
    EXPECT_TRUE(x == 0 || x == kFadeTile - 1 || y == 0 || y == kFadeTile - 1) << x << ", " << y;
  }
  EXPECT_GT(of_one, now.target.size() * 3 / 4);
  EXPECT_GT(between, 100U);
}

// The grids of both rasters show the same places: what is linear over the plate is drawn alike.
TEST_F(RendererLevelsTest, ASmallerRasterShowsTheSamePlaces) {
  const ShaderMaterial places(std::string("return vec3(uv, 0.5);"));
  std::vector<Level> levels{{&places, {}}};
  for (const double scale : {0.25, 0.5, 0.71, 0.9}) levels.push_back({&places, {.scale = scale}});
  const auto renderer = make(levels);
  ASSERT_TRUE(renderer) << renderer.error().what;
  const Picture full = picture(**renderer, frame(0));
  const auto brightest = std::ranges::max_element(
      full.target, {}, [](const Rgb32f& pixel) { return pixel.maxCoeff(); });
  // Half floats, and what perspective adds to a linear function over four pixels. Half a pixel
  // aside would be 0.01.
  const float tolerance = 3e-3F * brightest->maxCoeff();
  for (std::size_t level = 1; level < levels.size(); ++level) {
    const Picture scaled = picture(**renderer, frame(level));
    (*renderer)->finish();
    EXPECT_EQ((*renderer)->statistics().covered_pixels, covered(scaled));
    // The silhouette moves by no more than half a small pixel.
    EXPECT_NEAR(static_cast<double>(covered(scaled)), static_cast<double>(covered(full)), 150.0);
    std::size_t compared = 0;
    constexpr int kAway = 5;  // from the edge of the plate
    for (int y = kAway; y < kHeight - kAway; ++y) {
      for (int x = kAway; x < kWidth - kAway; ++x) {
        const auto at = [&](int dx, int dy) {
          return static_cast<std::size_t>((y + dy) * kWidth + x + dx);
        };
        bool inside = true;
        for (const int dx : {-kAway, kAway})
          for (const int dy : {-kAway, kAway}) inside &= full.target[at(dx, dy)] != Rgb32f(0, 0, 0);
        if (!inside) continue;
        ASSERT_LT((scaled.target[at(0, 0)] - full.target[at(0, 0)]).cwiseAbs().maxCoeff(),
                  tolerance)
            << "level " << level << ": " << x << ", " << y;
        ++compared;
      }
    }
    EXPECT_GT(compared, 500U);
  }
}

TEST_F(RendererLevelsTest, AnotherProfileReachesAll) {
  const std::vector<Level> levels{
      {&warm_, {}}, {&cold_, {.scale = 0.5}}, {&smooth_, {.evaluation = Evaluation::kCompute}}};
  const auto exchanged = make(levels);
  ASSERT_TRUE(exchanged) << exchanged.error().what;
  profile_.geometry.world_from_projector = look_at({-0.3, 0.1, 0.9}, {0, 0, 0}, {0, 1, 0});
  profile_.reference_distance_m = 0.8;
  ASSERT_TRUE((*exchanged)->set_profile(PreparedProfile::prepare(profile_, options_).value()));
  const auto made = make(levels);
  ASSERT_TRUE(made) << made.error().what;
  for (std::size_t level = 0; level < levels.size(); ++level)
    EXPECT_TRUE(picture(**exchanged, frame(level)) == picture(**made, frame(level))) << level;
}

TEST_F(RendererLevelsTest, AFadeThatIsNoneIsDark) {
  for (const double scale : {1.0, 0.5}) {
    const auto renderer = make({{&warm_, {}}, {&cold_, {.scale = scale}}});
    ASSERT_TRUE(renderer) << renderer.error().what;
    const Picture sound = picture(**renderer, frame(0, 1, 0.5));
    ASSERT_GT(covered(sound), 1000U);
    for (const double bad : {-1e-9,
                             1 + 1e-9,
                             std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
      for (const std::size_t next : {0, 1}) {
        const Picture dark = picture(**renderer, frame(0, next, bad));
        EXPECT_EQ(covered(dark), 0U) << bad;
        EXPECT_TRUE(std::ranges::all_of(dark.codes, [](const Rgb16& code) {
          return code == Rgb16{};
        })) << bad;
      }
      EXPECT_TRUE(picture(**renderer, frame(0, 1, 0.5)) == sound) << bad;
    }
  }
}

TEST_F(RendererLevelsTest, ErrorsSayWhichLevel) {
  const ShaderMaterial broken(std::string("return nonsense;"));
  const auto refused = [&](const std::vector<Level>& levels) {
    const auto renderer = make(levels);
    return renderer ? std::string() : renderer.error().what;
  };
  const auto expect_names = [](const std::string& what, const char* level, const char* reason) {
    EXPECT_NE(what.find(level), std::string::npos) << what;
    EXPECT_NE(what.find(reason), std::string::npos) << what;
  };
  expect_names(refused({{&warm_, {}}, {&broken, {}}}), "level 1 of 0 to 1 (shader)", "nonsense");
  expect_names(refused({{&warm_, {}}, {&cold_, {}}, {&warm_, {.scale = 0.2}}}),
               "level 2 of 0 to 2",
               "the scale at which is drawn is 0.2");
  expect_names(
      refused({{&warm_, {.scale = std::numeric_limits<double>::quiet_NaN()}}, {&cold_, {}}}),
      "level 0 of 0 to 1",
      "scale");
  expect_names(refused({{&warm_, {}},
                        {&smooth_, {.cache = {.spacing = 8}, .evaluation = Evaluation::kCompute}}}),
               "level 1 of 0 to 1",
               "angular cache");
  // Of one alone there is no doubt.
  EXPECT_EQ(refused({{&broken, {}}}).find("level"), std::string::npos);
}

}  // namespace
}  // namespace veneer::render
