// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>

#include "base/testing/temporary_folder.h"
#include "btf/importers/importer.h"
#include "btf/interpolated_set.h"
#include "quality/internal_test_scenes.h"
#include "quality/plan/on_screen.h"
#include "quality/reach.h"
#include "quality/visible_difference.h"

// What a fit to a scene gains on a measured material: docs/howto/plan.md.
namespace veneer::quality {
namespace {

struct Fitted {
  std::shared_ptr<const btf::Material> material;
  double set_rmse;
  double drawn_rmse;
  int fetches;
  double bytes;
};

class RealPlan : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("VENEER_DATA");
    const auto source =
        std::filesystem::path(data == nullptr ? "" : data) / "btfbase" / "wallpaper";
    if (data == nullptr || !std::filesystem::exists(source))
      GTEST_SKIP() << "real data absent: VENEER_DATA names no folder with btfbase/wallpaper";
    const auto path = folder_.path() / "wallpaper.btfset";
    const Status imported = (*btf::find_importer("btfbase"))
                                ->run(source, path, {.crop = btf::Crop{96, 96, 64, 64}}, silent_);
    ASSERT_TRUE(imported) << imported.error().what;
    auto set = btf::SampleSet::open(path);
    ASSERT_TRUE(set) << set.error().what;
    set_ = std::make_unique<btf::SampleSet>(*set);
  }
  Fitted fit(const btf::FitOptions& options,
             const Reach& reach,
             const VisibleDifferences& from_full) {
    auto material = (*btf::find_model("revised-lpca"))->fit(*set_, options, silent_);
    EXPECT_TRUE(material) << material.error().what;
    const btf::Material& m = **material;
    const btf::ModelShader shader = m.shader();
    const VisibleDifference difference =
        from_full.of([&m](int t, const btf::Direction& v, const btf::Direction& l) {
          return m.radiance(t, v, l);
        });
    const double set_rmse = *weighted_rmse(*set_, m, reach.region.weights);
    return {std::move(*material),
            set_rmse,
            difference.rmse,
            shader.fetches,
            static_cast<double>(shader.gpu_bytes())};
  }
  TemporaryFolder folder_;
  SilentProgress silent_;
  std::unique_ptr<btf::SampleSet> set_;
};

// One light that stays where it is, and an eye on an arc of 60 degrees before a plate.
TEST_F(RealPlan, HasLessErrorThanTheGeneralFitAndCostsLessAtEqualError) {
  render::Scene scene = testing::plate(-30, 30, 1);
  scene.observer_region->elevation = {15 * testing::kDegree, 45 * testing::kDegree};
  scene.lights = {render::DirectionalLight{testing::place(45, 0), {1300, 1300, 1300}}};
  const auto profile = testing::front_projector();
  const auto reach = find_reach(scene, profile, set_->info(), silent_);
  ASSERT_TRUE(reach) << reach.error().what;
  auto from_full = VisibleDifferences::make(profile, reach->asked, set_->info());
  ASSERT_TRUE(from_full) << from_full.error().what;
  const btf::InterpolatedSet full(*set_);
  from_full->set_reference([&full](int t, const btf::Direction& v, const btf::Direction& l) {
    return full.radiance(t, v, l);
  });
  btf::FitOptions options;
  options.components = "4";
  const Fitted general4 = fit(options, *reach, *from_full);
  options.components = "8";
  const Fitted general8 = fit(options, *reach, *from_full);
  options.region = &reach->region;
  options.components = "4";
  const Fitted planned4 = fit(options, *reach, *from_full);
  // Clusters cost no fetches, and over so small a box hardly any bytes.
  options.components = "2";
  options.clusters = 128;
  const Fitted planned2 = fit(options, *reach, *from_full);
  for (const auto& [name, f] : {std::pair{"general 4", general4},
                                {"general 8", general8},
                                {"planned 4", planned4},
                                {"planned 2, 128 clusters", planned2}})
    std::printf("%s: rmse %.4f in the set, %.4f drawn, %d fetches, %.3f MB\n",
                name,
                f.set_rmse,
                f.drawn_rmse,
                f.fetches,
                f.bytes / 1e6);
  EXPECT_LE(planned4.set_rmse, 0.6 * general4.set_rmse);
  EXPECT_LE(planned4.drawn_rmse, 0.6 * general4.drawn_rmse);
  EXPECT_LE(planned2.set_rmse, general8.set_rmse);
  EXPECT_LE(planned2.drawn_rmse, general8.drawn_rmse);
  EXPECT_LE(3 * planned2.fetches, general8.fetches);
  EXPECT_LE(10 * planned2.bytes, general8.bytes);

  // On the raster, by the GPU.
  Plan drawn;
  drawn.chosen.material = planned4.material;
  drawn.general.emplace().material = general4.material;
  const Status measured = measure_plan_on_screen(drawn, full, scene, profile, silent_);
  ASSERT_TRUE(measured) << measured.error().what;
  const ScreenErrors& planned = drawn.chosen.on_screen->averaged;
  const ScreenErrors& general = drawn.general->on_screen->averaged;
  for (const auto& [name, e] : {std::pair{"general 4", general}, std::pair{"planned 4", planned}})
    std::printf(
        "%s on the screen: asked for mean %.2f, 95 %% %.2f, most %.2f dE00, eps %.4f, rmse %.4f; "
        "received mean %.2f, 95 %% %.2f, most %.2f dE00, eps %.4f, rmse %.4f\n",
        name,
        e.target.de00_mean,
        e.target.de00_p95,
        e.target.de00_max,
        e.target.epsilon,
        e.target.rmse,
        e.received.de00_mean,
        e.received.de00_p95,
        e.received.de00_max,
        e.received.epsilon,
        e.received.rmse);
  EXPECT_LE(planned.target.rmse, 0.6 * general.target.rmse);
  EXPECT_LE(planned.received.rmse, 0.6 * general.received.rmse);
}

}  // namespace
}  // namespace veneer::quality
