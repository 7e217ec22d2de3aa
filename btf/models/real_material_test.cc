// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include "base/parallel.h"
#include "base/testing/temporary_folder.h"
#include "btf/elevated_concentric.h"
#include "btf/evaluation.h"
#include "btf/fit_region.h"
#include "btf/importers/importer.h"
#include "btf/material.h"

// Fits of a real measured material against the figures that this project started from.
namespace veneer::btf {
namespace {

class RealMaterial : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const char* data = std::getenv("VENEER_DATA");
    if (data == nullptr) return;
    const auto source = std::filesystem::path(data) / "btfbase" / "wallpaper";
    if (!std::filesystem::exists(source)) return;
    folder_ = std::make_unique<TemporaryFolder>();
    const auto path = folder_->path() / "wallpaper.btfset";
    SilentProgress progress;
    const Status imported =
        (*find_importer("btfbase"))->run(source, path, {.crop = Crop{96, 96, 64, 64}}, progress);
    ASSERT_TRUE(imported) << imported.error().what;
    auto set = SampleSet::open(path);
    ASSERT_TRUE(set) << set.error().what;
    set_ = std::make_unique<SampleSet>(*set);
  }
  static void TearDownTestSuite() {
    set_.reset();
    folder_.reset();
  }

  void SetUp() override {
    if (!set_)
      GTEST_SKIP() << "real data absent: VENEER_DATA names no folder with btfbase/wallpaper";
  }

  // Mean absolute difference after the exponent 1/2.2, over all texels, pairs and channels.
  static double epsilon(std::string_view model, const std::string& components) {
    FitOptions options;
    options.components = components;
    SilentProgress progress;
    const auto material = (*find_model(model))->fit(*set_, options, progress);
    if (!material) {
      ADD_FAILURE() << material.error().what;
      return 1.0;
    }
    const auto encode = [](float x) { return std::pow(std::clamp(x, 0.0F, 1.0F), 1.0F / 2.2F); };
    const auto values = static_cast<std::size_t>(set_->info().pair_count()) * 3;
    const int texels = set_->info().texel_count();
    std::mutex mutex;
    double sum = 0.0;
    parallel_for(texels, 64, [&](std::int64_t begin, std::int64_t end) {
      std::vector<float> wanted(values);
      std::vector<float> got(values);
      double piece = 0.0;
      for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
        set_->rgb(texel, Part::kTotal, wanted);
        (*material)->reconstruct(texel, got);
        for (std::size_t i = 0; i < values; ++i)
          piece += std::abs(encode(wanted[i]) - encode(got[i]));
      }
      const std::lock_guard lock(mutex);
      sum += piece;
    });
    return sum / (double(values) * texels);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::unique_ptr<SampleSet> set_;
};
std::unique_ptr<TemporaryFolder> RealMaterial::folder_;
std::unique_ptr<SampleSet> RealMaterial::set_;

// Figures of docs and issue: a prototype's plus 5 %.
TEST_F(RealMaterial, LpcaReachesTheKnownErrors) {
  EXPECT_LE(epsilon("lpca", "1"), 0.0198);
  EXPECT_LE(epsilon("lpca", "2"), 0.0145);
  EXPECT_LE(epsilon("lpca", "4"), 0.0098);
  EXPECT_LE(epsilon("lpca", "8"), 0.0065);
}

TEST_F(RealMaterial, TexelColoursReachTheKnownErrors) {
  EXPECT_LE(epsilon("texel-colours", "3+1"), 0.0129);
  EXPECT_LE(epsilon("texel-colours", "6+2"), 0.0096);
}

// One fixed light at 45 degrees and an observer between 15 and 60 degrees in an arc of 60 of
// azimuth: 10 of the set's 6561 pairs.
FitRegion scene_of_one_light(const SampleSetInfo& info) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const auto is_light = [](const Angles& at) {
    return std::abs(at.theta - 45 * kDegree) < 1e-3 && std::abs(at.phi) < 1e-3;
  };
  const auto is_seen = [](const Angles& at) {
    return at.theta > 14 * kDegree && at.theta < 61 * kDegree && at.phi < 59 * kDegree;
  };
  FitRegion region;
  region.views = {1.0, 0.0, 1.0, 0.0};
  for (const Direction& view : info.views)
    for (const Direction& light : info.lights) {
      const bool reached =
          is_seen(angles_from_direction(view)) && is_light(angles_from_direction(light));
      region.weights.weight.push_back(reached ? 1.0F : 0.0F);
      if (!reached) continue;
      const Eigen::Vector2d v = square_from_direction(view);
      const Eigen::Vector2d l = square_from_direction(light);
      region.lights = {l.x(), l.x(), l.y(), l.y()};
      region.views = {std::min(region.views.u_min, v.x()),
                      std::max(region.views.u_max, v.x()),
                      std::min(region.views.v_min, v.y()),
                      std::max(region.views.v_max, v.y())};
    }
  return region;
}

struct Measured {
  double rmse;     // in linear light, over the reachable pairs
  double epsilon;  // encoded
  double drawn;    // encoded epsilon, as the shader draws
  int fetches;
  double bytes;
};

Measured measure(const SampleSet& set,
                 std::string_view model,
                 const std::string& components,
                 const FitRegion& reachable,
                 bool restricted) {
  FitOptions options;
  options.components = components;
  if (restricted) options.region = &reachable;
  SilentProgress progress;
  const auto material = (*find_model(model))->fit(set, options, progress);
  if (!material) throw std::runtime_error(material.error().what);
  const auto error = evaluate(set, **material, progress, &reachable.weights);
  if (!error) throw std::runtime_error(error.error().what);
  const Measured result{error->linear.rmse,
                        error->encoded.epsilon_avg,
                        error->drawn_epsilon_avg,
                        error->fetches,
                        double((*material)->shader().gpu_bytes())};
  fmt::print("{:<14} {:>4} {:<10} rmse {:.4f} epsilon {:.4f} drawn {:.4f} fetches {:>3} {:>12} B\n",
             model,
             components,
             restricted ? "restricted" : "general",
             result.rmse,
             result.epsilon,
             result.drawn,
             result.fetches,
             result.bytes);
  return result;
}

// Targets of the issue: at most 0.6 times the general fit's error with as many components; at no
// larger error at most a third of its fetches and a tenth of its bytes.
TEST_F(RealMaterial, AFitForOneLightNeedsAPartOfTheGeneralOnesCost) {
  const FitRegion reachable = scene_of_one_light(set_->info());
  const Measured general = measure(*set_, "revised-lpca", "4", reachable, false);
  EXPECT_LE(measure(*set_, "revised-lpca", "4", reachable, true).rmse, 0.6 * general.rmse);
  const Measured equal = measure(*set_, "revised-lpca", "2", reachable, true);
  EXPECT_LE(equal.rmse, general.rmse);
  EXPECT_LE(equal.drawn, general.drawn);
  EXPECT_LE(3 * equal.fetches, general.fetches);
  EXPECT_LE(10 * equal.bytes, general.bytes);
}

// The figures of docs/fitting.md.
TEST_F(RealMaterial, DISABLED_TableOfFitsForOneLight) {
  const FitRegion reachable = scene_of_one_light(set_->info());
  for (const auto& [model, sizes] : {std::pair{"revised-lpca", std::array{"1", "2", "4", "8"}},
                                     {"lpca", std::array{"1", "2", "4", "8"}},
                                     {"texel-colours", std::array{"1+1", "2+1", "3+1", "6+2"}}})
    for (const bool restricted : {true, false})
      for (const char* components : sizes) {
        if (restricted && std::string_view(components) == sizes.back()) continue;
        EXPECT_GT(measure(*set_, model, components, reachable, restricted).bytes, 0.0);
      }
}

}  // namespace
}  // namespace veneer::btf
