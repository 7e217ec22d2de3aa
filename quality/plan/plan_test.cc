// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/plan.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/files.h"
#include "base/testing/browser.h"
#include "base/testing/temporary_folder.h"
#include "btf/internal_test_sets.h"
#include "btf/interpolated_set.h"
#include "quality/internal_test_scenes.h"
#include "quality/plan/on_screen.h"
#include "quality/plan/plan_report.h"

namespace veneer::quality {
namespace {

using testing::front_projector;
using testing::kDegree;
using testing::plate;

// The normal and two rings.
btf::DirectionSet nineteen() {
  btf::DirectionSet directions = btf::testing::ring(6, 0.6);
  for (int i = 0; i < 12; ++i)
    directions.push_back(btf::direction_from_angles({1.2, std::numbers::pi * i / 6}));
  return directions;
}

// 12 x 12 texels, each of a body colour and a relief of its own, of more kinds than one Eigen-BRDF
// can tell, under a lobe of the half angle. @param shine  0: matte.
btf::SampleSet made_set(const std::filesystem::path& folder, bool polarised, double shine) {
  btf::SampleSetInfo info;
  info.width = info.height = 12;
  info.polarised = polarised;
  info.views = info.lights = nineteen();
  info.source = "a formula";
  std::filesystem::create_directories(folder);
  return btf::testing::make_set(
      folder / "set.btfset", info, [=](int texel, int view, int light, int channel) {
        const btf::Direction& v = info.views[static_cast<std::size_t>(view)];
        const btf::Direction& l = info.lights[static_cast<std::size_t>(light)];
        Pcg32 random(static_cast<std::uint64_t>(texel) + 1);
        const auto about_zero = [&](double most) { return most * (2 * random.uniform() - 1); };
        const double body = (0.2 + 0.1 * (channel % 3)) * (0.4 + 0.6 * random.uniform());
        const double relief = 1 + about_zero(0.5) * l.x() + about_zero(0.5) * l.y() +
                              about_zero(0.4) * v.x() + about_zero(0.4) * v.y();
        const double diffuse = std::max(0.0, body * relief * l.z());
        const double lobe =
            shine * (0.5 + 0.5 * random.uniform()) * std::pow((v + l).normalized().z(), 40) * l.z();
        if (!polarised) return static_cast<float>(diffuse + lobe);
        return static_cast<float>(channel < 3 ? lobe : diffuse);
      });
}

class Planned : public ::testing::Test {
 protected:
  Result<Plan> plan(const btf::SampleSet& set,
                    const render::Scene& scene,
                    const PlanOptions& options,
                    const TimeMaterial& time = {}) {
    SilentProgress silent;
    return make_plan(set, scene, front_projector(), options, time, silent);
  }
  TemporaryFolder folder_;
};

TEST_F(Planned, AddsComponentsUntilTheErrorIsNotSeenAndNoFurther) {
  const btf::SampleSet set = made_set(folder_.path(), false, 0.5);
  PlanOptions options;
  options.models = {"revised-lpca"};
  options.max_de00 = 0.3;
  const auto made = plan(set, plate(-30, 30, 1), options);
  ASSERT_TRUE(made) << made.error().what;
  EXPECT_TRUE(made->is_invisible);
  EXPECT_TRUE(made->chosen.difference.de00_mean <= 0.3 || made->chosen.difference.codes_mean < 1);
  // Whatever costs less was seen to be worse.
  int cheaper = 0;
  for (const PlanStep& step : made->steps) {
    if (std::tuple(step.fetches, step.bytes) >=
        std::tuple(made->chosen.fetches, made->chosen.bytes))
      continue;
    ++cheaper;
    EXPECT_GT(step.difference.de00_mean, 0.3) << step.what;
    EXPECT_GE(step.difference.codes_mean, 1.0) << step.what;
  }
  EXPECT_GT(cheaper, 0);
  ASSERT_TRUE(made->general && made->general_alike);
  EXPECT_EQ(made->general->options.components, made->chosen.options.components);
  EXPECT_LE(made->chosen.bytes, made->general->bytes);
  EXPECT_LE(made->chosen.fetches, made->general_alike->fetches);
}

TEST_F(Planned, AsksForMoreWhereLessIsGoodEnough) {
  const btf::SampleSet set = made_set(folder_.path(), false, 0.5);
  PlanOptions options;
  options.compare_general = false;
  options.models = {"texel-colours", "revised-lpca"};
  options.max_de00 = 0.1;
  const auto strict = plan(set, plate(-30, 30, 1), options);
  options.max_de00 = 5;
  const auto lax = plan(set, plate(-30, 30, 1), options);
  ASSERT_TRUE(strict && lax);
  EXPECT_TRUE(lax->is_invisible);
  EXPECT_LE(std::tuple(lax->chosen.fetches, lax->chosen.bytes),
            std::tuple(strict->chosen.fetches, strict->chosen.bytes));
}

TEST_F(Planned, DropsTheSpecularTermOfAMatteMaterial) {
  PlanOptions options;
  options.compare_general = false;
  options.models = {"dichromatic-lpca"};
  const btf::SampleSet matte = made_set(folder_.path() / "matte", true, 1e-4);
  const auto without = plan(matte, plate(-30, 30, 1), options);
  ASSERT_TRUE(without) << without.error().what;
  ASSERT_EQ(without->dropped.size(), 1);
  EXPECT_FALSE(without->chosen.material->has_specular_term());
  const auto step = std::ranges::find_if(
      without->steps, [](const PlanStep& s) { return s.what.starts_with("leave out"); });
  ASSERT_NE(step, without->steps.end());
  EXPECT_TRUE(step->taken);
  EXPECT_TRUE(step->difference.de00_max < 0.5 || step->difference.codes_max < 1);
  EXPECT_NE(without->dropped.front().find("it saves 2 of 8 fetches"), std::string::npos)
      << without->dropped.front();
  EXPECT_TRUE(without->is_invisible);
  const btf::SampleSet glossy = made_set(folder_.path() / "glossy", true, 0.5);
  const auto with = plan(glossy, plate(-30, 30, 1), options);
  ASSERT_TRUE(with) << with.error().what;
  EXPECT_TRUE(with->dropped.empty());
  EXPECT_TRUE(with->chosen.material->has_specular_term());
}

// The lobe is there in the data, but no eye of this scene comes near it.
TEST_F(Planned, DropsATermThatTheSceneNeverShows) {
  PlanOptions options;
  options.compare_general = false;
  options.models = {"dichromatic-lpca"};
  const btf::SampleSet glossy = made_set(folder_.path(), true, 0.5);
  render::Scene beside = plate(0, 0, 3);
  beside.observer_region = testing::arc(-3, 3, 60, 3);
  beside.lights = {render::DirectionalLight{testing::place(0, 62), {300, 300, 300}}};
  const auto made = plan(glossy, beside, options);
  ASSERT_TRUE(made) << made.error().what;
  EXPECT_EQ(made->dropped.size(), 1);
}

TEST_F(Planned, KeepsToTheTimeOfAFrame) {
  const btf::SampleSet set = made_set(folder_.path(), false, 0.5);
  PlanOptions options;
  options.compare_general = false;
  options.models = {"revised-lpca"};
  options.max_de00 = 0.05;
  // Under enough light for one component's error to be more than a code value.
  render::Scene bright = plate(-30, 30, 1);
  bright.lights = {render::DirectionalLight{testing::place(0, 45), {2000, 2000, 2000}}};
  // A machine on which a fetch takes a millisecond.
  const TimeMaterial clock = [](const btf::Material& material) -> Result<double> {
    return material.shader().fetches;
  };
  const auto free = plan(set, bright, options, clock);
  ASSERT_TRUE(free) << free.error().what;
  options.frame_ms = free->chosen.fetches - 1;
  const auto bound = plan(set, bright, options, clock);
  ASSERT_TRUE(bound) << bound.error().what;
  EXPECT_LE(*bound->chosen.frame_ms, *options.frame_ms);
  EXPECT_GE(bound->chosen.difference.de00_mean, free->chosen.difference.de00_mean);
  options.frame_ms = 0.01;
  const auto hopeless = plan(set, bright, options, clock);
  ASSERT_TRUE(hopeless) << hopeless.error().what;
  EXPECT_NE(plan_text(*hopeless).find("fast enough"), std::string::npos);
}

TEST_F(Planned, TriesWhatSuitsSetAndScene) {
  btf::SampleSetInfo info;
  Reach reach;
  EXPECT_EQ(planned_models(info, reach),
            (std::vector<std::string>{"phong", "lafortune", "texel-colours", "revised-lpca"}));
  info.polarised = true;
  reach.region.lights = {0.5, 0.51, 0.3, 0.31};
  EXPECT_EQ(planned_models(info, reach),
            (std::vector<std::string>{"phong",
                                      "lafortune",
                                      "dichromatic-lpca",
                                      "texel-colours",
                                      "revised-lpca",
                                      "eigen-texture"}));
  for (const std::string& model : planned_models(info, reach)) EXPECT_TRUE(btf::find_model(model));
}

TEST_F(Planned, TellsWhatItFoundInTextNumbersAndAPage) {
  const btf::SampleSet set = made_set(folder_.path(), true, 1e-4);
  PlanOptions options;
  options.models = {"dichromatic-lpca"};
  const auto made = plan(set, plate(-30, 30, 1), options);
  ASSERT_TRUE(made) << made.error().what;
  const PlanSource source{"a set", "a scene", "a <profile>"};
  const nlohmann::ordered_json json = plan_json(*made, source);
  EXPECT_EQ(json["chosen"]["fetches"], made->chosen.fetches);
  EXPECT_EQ(json["steps"].size(), made->steps.size());
  EXPECT_EQ(json["dropped"].size(), 1);
  const std::string text = plan_text(*made);
  EXPECT_NE(text.find(region_in_words(made->reach)), std::string::npos);
  EXPECT_NE(text.find("dropped: specular term"), std::string::npos);
  const auto page = folder_.path() / "plan.html";
  ASSERT_TRUE(write_plan_page(page, *made, source, set.info()));
  const auto html = read_text(page);
  ASSERT_TRUE(html);
  EXPECT_EQ(html->find("{{DATA}}"), std::string::npos);
  EXPECT_EQ(html->find("http://www.w3.org/2000/svg"), html->rfind("http"));  // no network
  const auto material = folder_.path() / "m.safetensors";
  ASSERT_TRUE(btf::save_material(
      *made->chosen.material, material, plan_provenance(*made, source, set.info())));
  const auto file = SafetensorsFile::open(material);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->metadata().at("planned_for"), "a scene");
  EXPECT_EQ(file->metadata().at("planned_region"), region_in_words(made->reach));
}

/// What is to be seen of the page.
constexpr char kLook[] = R"(
const texts = selector => [...document.querySelectorAll(selector)].map(e => e.textContent);
const plot = id => {
  const circles = [...document.querySelectorAll(`#${id} circle`)];
  const of = name => circles.map(c => +c.getAttribute(name));
  return {
    circles: circles.length, lines: document.querySelectorAll(`#${id} polygon`).length,
    furthest: Math.max(...circles.map(c => Math.hypot(c.getAttribute('cx'), c.getAttribute('cy')))),
    least_radius: Math.min(...of('r')), width: document.getElementById(id).getBoundingClientRect().width,
    outline: document.querySelector(`#${id} polygon`).getAttribute('points').split(' ').map(p => p.split(',').map(Number)),
  };
};
return {
  title: document.title, lead: texts('#lead')[0], text: texts('#text')[0],
  views: plot('views'), lights: plot('lights'),
  steps: texts('#steps tbody td:first-child'), verdicts: texts('#steps tbody td:last-child'),
  taken: document.querySelectorAll('#steps tr.taken').length,
  saved: texts('#saved tbody td:first-child'), fetches: texts('#saved tbody td:nth-child(2)'),
  screen: texts('#screen tbody td:nth-child(4)'),
  screen_height: document.getElementById('screen-part').getBoundingClientRect().height,
  clickable: document.querySelectorAll('button, a, input, select, [onclick], summary').length,
  too_wide: document.documentElement.scrollWidth - innerWidth,
};)";

TEST_F(Planned, ItsPageDrawsItsFiguresInABrowser) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const btf::SampleSet set = made_set(folder_.path(), true, 1e-4);
  PlanOptions options;
  options.models = {"dichromatic-lpca"};
  auto made = plan(set, plate(-30, 30, 1), options);
  ASSERT_TRUE(made) << made.error().what;
  ASSERT_TRUE(made->general);
  const PlanSource source{"a set", "a scene", "a </script> <profile> \xc3\xa4"};
  const auto page_seen = [&] {
    const auto page = folder_.path() / "plan.html";
    EXPECT_TRUE(write_plan_page(page, *made, source, set.info()));
    const auto seen = seen_in_browser(read_text(page).value(), kLook);
    EXPECT_TRUE(seen) << seen.error().what;
    const auto all = nlohmann::json::parse(seen.value_or("{}"));
    EXPECT_EQ(all["faults"], nlohmann::json::array());
    return all["found"];
  };
  const nlohmann::json seen = page_seen();

  EXPECT_EQ(seen["text"], plan_text(*made));
  EXPECT_EQ(
      seen["lead"],
      "a set, planned for a scene on a </script> <profile> \xc3\xa4: " + made->chosen.name() + ".");
  // Three rings, what is measured, and a sample of what is asked.
  constexpr std::size_t kMostAsked = 1500;
  const auto asked =
      std::span(made->reach.asked).first(std::min(made->reach.asked.size(), kMostAsked));
  std::size_t asked_lights = 0;
  for (const Asked& one : asked) asked_lights += static_cast<std::size_t>(one.lights);
  EXPECT_EQ(seen["views"]["circles"], 3 + set.info().views.size() + asked.size());
  EXPECT_EQ(seen["lights"]["circles"], 3 + set.info().lights.size() + asked_lights);
  for (const char* id : {"views", "lights"}) {
    const nlohmann::json& plot = seen[id];
    EXPECT_LE(plot["furthest"], 1.0) << id;  // none below the horizon
    EXPECT_GT(plot["least_radius"], 0.0) << id;
    EXPECT_GT(plot["width"], 200.0) << id;
    EXPECT_EQ(plot["lines"], 1) << id;
    for (const nlohmann::json& point : plot["outline"])
      EXPECT_LE(std::hypot(point[0].get<double>(), point[1].get<double>()), 1.0001) << id;
  }
  ASSERT_EQ(seen["steps"].size(), made->steps.size());
  for (std::size_t i = 0; i < made->steps.size(); ++i) {
    EXPECT_EQ(seen["steps"][i], made->steps[i].what);
    EXPECT_EQ(seen["verdicts"][i], made->steps[i].verdict);
  }
  EXPECT_EQ(seen["taken"], std::ranges::count_if(made->steps, &PlanStep::taken));
  EXPECT_EQ(seen["saved"][0], made->chosen.name());
  EXPECT_EQ(seen["saved"][1], made->general->name());
  EXPECT_EQ(seen["fetches"][0], std::to_string(made->chosen.fetches));
  EXPECT_EQ(seen["clickable"], 0);  // what can be clicked is to be clicked here
  EXPECT_LE(seen["too_wide"], 0);
  // What was not measured is not shown, and what was is.
  EXPECT_TRUE(seen["screen"].empty());
  EXPECT_EQ(seen["screen_height"], 0);
  OnScreen errors;
  errors.centre.target.de00_mean = 1.25;
  errors.averaged.received.de00_mean = 2.5;
  made->chosen.on_screen = errors;
  const nlohmann::json measured = page_seen();
  EXPECT_EQ(measured["screen"], nlohmann::json({"1.25", "0.00", "0.00", "2.50"}));
  EXPECT_GT(measured["screen_height"], 100.0);
}

// Two ways to the same figure: what is asked, in double precision on the CPU, and what the GPU
// drew, read back from the raster. They sample the region at other places, so they agree to a few
// parts in ten of what is seen, and never order two fits otherwise where those are far apart.
TEST_F(Planned, DrawsOnTheScreenAboutTheErrorThatItForesaw) {
  const btf::SampleSet set = made_set(folder_.path(), false, 0.5);
  PlanOptions options;
  options.models = {"revised-lpca"};
  options.max_de00 = 0.3;
  const render::Scene scene = plate(-30, 30, 1);
  auto made = plan(set, scene, options);
  ASSERT_TRUE(made) << made.error().what;
  EXPECT_FALSE(made->chosen.on_screen);
  const PlanSource source{"a set", "a scene", "a profile"};
  EXPECT_FALSE(plan_json(*made, source)["chosen"].contains("on_screen"));
  EXPECT_EQ(plan_text(*made).find("on the screen"), std::string::npos);
  SilentProgress silent;
  const btf::InterpolatedSet full(set);
  const Status measured = measure_plan_on_screen(*made, full, scene, front_projector(), silent);
  ASSERT_TRUE(measured) << measured.error().what;
  for (const PlannedFit* fit : {&made->chosen, &*made->general, &*made->general_alike}) {
    ASSERT_TRUE(fit->on_screen) << fit->name();
    const double foreseen = fit->difference.de00_mean;
    const OnScreen& seen = *fit->on_screen;
    EXPECT_NEAR(seen.averaged.target.de00_mean, foreseen, 0.3 * foreseen + 0.02) << fit->name();
    // Pixels are much narrower than texels here: what lies between texels neither adds nor takes.
    EXPECT_NEAR(seen.averaged.target.rmse, seen.centre.target.rmse, 0.01 * seen.centre.target.rmse)
        << fit->name();
    EXPECT_GT(seen.averaged.received.de00_mean, 0) << fit->name();
    EXPECT_EQ(seen.centre.target.pixels, seen.averaged.received.pixels);
  }
  const nlohmann::ordered_json json = plan_json(*made, source);
  for (const char* which : {"chosen", "general", "general_alike"})
    EXPECT_GT(json[which]["on_screen"]["averaged"]["received"]["de00_mean"], 0) << which;
  EXPECT_EQ(json["general"]["screen_rmse_ratio"],
            made->chosen.on_screen->averaged.target.rmse /
                made->general->on_screen->averaged.target.rmse);
  EXPECT_NE(plan_text(*made).find("on the screen, a pixel's mean"), std::string::npos);
}

TEST_F(Planned, RefusesWhatCannotBePlanned) {
  const btf::SampleSet set = made_set(folder_.path(), false, 0.5);
  const auto refusal = [&](const PlanOptions& options, const render::Scene& scene) {
    const auto made = plan(set, scene, options);
    return made ? std::string() : made.error().what;
  };
  const render::Scene scene = plate(-30, 30, 1);
  EXPECT_NE(refusal({.max_de00 = 0}, scene).find("max-de00"), std::string::npos);
  EXPECT_NE(refusal({.max_de00 = NAN}, scene).find("max-de00"), std::string::npos);
  EXPECT_NE(refusal({.frame_ms = -1}, scene).find("frame-ms"), std::string::npos);
  EXPECT_NE(refusal({.models = {"velvet"}}, scene).find("velvet"), std::string::npos);
  EXPECT_NE(refusal({.models = {"dichromatic-lpca"}}, scene).find("specular and diffuse"),
            std::string::npos);
  render::Scene blind = scene;
  blind.observer_region.reset();
  EXPECT_NE(refusal({}, blind).find("[observer.region]"), std::string::npos);
}

}  // namespace
}  // namespace veneer::quality
