// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/plan.h"

#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "btf/interpolated_set.h"
#include "cli/commands/commands.h"
#include "quality/plan/frame_time.h"
#include "quality/plan/on_screen.h"
#include "quality/plan/plan_report.h"

namespace veneer::cli {

Result<int> run_plan(CommandLine& line) {
  std::filesystem::path set_path;
  std::filesystem::path scene_path;
  std::filesystem::path profile_path;
  std::filesystem::path out;
  std::filesystem::path page;
  quality::PlanOptions options;
  double frame_ms = 0;
  bool no_general = false;
  bool on_screen = false;
  CLI::App& app = line.app();
  app.add_option("set", set_path, "The sample set, NAME.btfset")->required();
  app.add_option("--scene",
                 scene_path,
                 "The scene, scene.toml, with [observer.region] and where lights move "
                 "[light.region]")
      ->required();
  app.add_option("--profile", profile_path, "The projector profile (veneer calibrate writes one)")
      ->required();
  app.add_option("-o,--output", out, "The material to write, NAME.safetensors")->required();
  const CLI::Option* frame_option = app.add_option(
      "--frame-ms", frame_ms, "What drawing a frame may take on this machine, milliseconds");
  app.add_option("--max-de00", options.max_de00, "The mean colour difference that is good enough")
      ->capture_default_str();
  app.add_option(
         "--models", options.models, "Models to try, joined by commas; else those that suit")
      ->delimiter(',');
  app.add_flag(
      "--no-general", no_general, "Do not fit for any scene too, which only tells what was saved");
  app.add_flag("--on-screen",
               on_screen,
               "Also draw what was planned and the fits for any scene, and measure them on the "
               "projector's raster; needs a GPU or its emulation");
  app.add_option("--report", page, "Also write what was found as one page, NAME.html");
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();
  if (frame_option->count() > 0) options.frame_ms = frame_ms;
  options.compare_general = !no_general;
  if (!page.empty() && page.extension() != ".html")
    return fail(Errc::kInvalidOption, "writing {}: the name must end in .html", page.string());
  VENEER_TRY(options.check());

  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(scene_path));
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(profile_path));
  const quality::TimeMaterial time = [&](const btf::Material& material) {
    return quality::draw_ms(scene, profile, material);
  };
  VENEER_ASSIGN(quality::Plan plan,
                quality::make_plan(set, scene, profile, options, time, line.progress()));
  if (on_screen)
    VENEER_TRY(quality::measure_plan_on_screen(
        plan, btf::InterpolatedSet(set), scene, profile, line.progress()));
  const quality::PlanSource source{set_path.string(), scene_path.string(), profile_path.string()};
  VENEER_TRY(btf::save_material(
      *plan.chosen.material, out, quality::plan_provenance(plan, source, set.info())));
  if (!page.empty()) VENEER_TRY(quality::write_plan_page(page, plan, source, set.info()));
  nlohmann::ordered_json json = quality::plan_json(plan, source);
  json["material"] = out.string();
  line.print(json, fmt::format("{}\nwrote {}", quality::plan_text(plan), out.string()));
  return kExitDone;
}

}  // namespace veneer::cli
