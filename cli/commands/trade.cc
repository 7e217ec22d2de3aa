// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <cstdio>
#include <optional>

#include "base/exit_code.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "cli/commands/commands.h"
#include "cli/trade/report.h"
#include "quality/trade/scene_tools.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

struct TradeRequest {
  fs::path set;
  fs::path scene;
  fs::path profile;
  fs::path out;
  fs::path material;
  std::string grid_name = "coarse";
  quality::GridOptions grid;
  quality::SceneToolsOptions tools;
  quality::Budget budget;

  [[nodiscard]] bool has_budget() const { return budget.ms || budget.mb || budget.de00; }
};

std::string last_name(const fs::path& path) {
  return (path / "").parent_path().filename().string();
}

std::string in_bytes(double bytes) {
  return bytes < 1e5 ? fmt::format("{:.1f} kB", bytes / 1e3)
                     : fmt::format("{:.1f} MB", bytes / 1e6);
}

std::string in_words(const quality::TradePoint& p) {
  return fmt::format("{}: {:.2f} ms ({:.1f} x plain), {}, {:.2f} dE00 (95 %: {:.2f})",
                     p.candidate.name(),
                     p.ms_median,
                     p.ratio,
                     in_bytes(p.gpu_bytes),
                     p.received_de00_mean,
                     p.received_de00_p95);
}

std::string in_configuration(const render::DrawingOptions& drawing) {
  return fmt::format("\n    average_texels = {}\n    cache_spacing_px = {}\n    scale = {:g}",
                     drawing.average_texels,
                     drawing.cache.spacing,
                     drawing.scale);
}

std::string summary(const quality::Trade& trade, const fs::path& page) {
  std::string text = fmt::format("wrote {}: {} ways to draw, {} left out; {} ({})",
                                 page.string(),
                                 trade.points.size(),
                                 trade.left_out.size(),
                                 trade.renderer,
                                 trade.clock);
  text += fmt::format(
      "\nno other way to draw is both cheaper and nearer by {:g} dE00 than one of these:",
      quality::kLeastGain);
  for (const std::size_t i : quality::pareto_front(trade.points, &quality::TradePoint::ms_median))
    text += "\n  " + in_words(trade.points[i]);
  if (const std::string idle = idle_caches_in_words(trade); !idle.empty()) text += "\n" + idle;
  return text;
}

Result<int> trade(const TradeRequest& request, CommandLine& line) {
  VENEER_TRY(request.tools.check());
  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(request.scene));
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(request.profile));
  VENEER_ASSIGN(btf::SampleSet samples, btf::SampleSet::open(request.set));
  VENEER_TRY(samples.check_finite());
  const btf::InterpolatedSet set(std::move(samples));
  quality::TradeRun run{.folder = request.out, .identity = {}, .source = set.set().info().source};
  VENEER_ASSIGN(run.identity,
                quality::identity_of(request.set,
                                     request.scene,
                                     scene.mesh_name,
                                     request.profile,
                                     request.grid,
                                     request.tools));
  VENEER_ASSIGN(const std::vector<quality::Candidate> candidates,
                quality::candidates_of(set.set().info(), request.grid));
  VENEER_ASSIGN(const quality::SceneTools tools,
                quality::SceneTools::make(scene, profile, set, request.tools, line.progress()));
  VENEER_ASSIGN(const quality::Trade trade,
                quality::run_trade(run, candidates, tools.tools(), line.progress()));

  TradeAbout about{.set = last_name(request.set),
                   .scene = last_name(request.scene),
                   .profile = last_name(request.profile),
                   .grid = request.grid_name,
                   .views = request.tools.views,
                   .frames = request.tools.frames,
                   .white_nits = profile.white().y(),
                   .chosen = {}};
  Result<std::size_t> chosen = fail(Errc::kInvalidOption, "no budget");
  if (request.has_budget()) {
    chosen = quality::choose(trade.points, request.budget);
    if (chosen) about.chosen = *chosen;
  }
  VENEER_TRY(write_trade_report(trade, about, tools.reference_crop(), request.out));
  std::string text = summary(trade, request.out / "index.html");
  if (chosen) {
    text += "\nchosen: " + in_words(trade.points[*chosen]);
    text += "\n  draw it with, in [render] of the daemon's configuration:" +
            in_configuration(trade.points[*chosen].candidate.drawing);
    if (!request.material.empty()) {
      const quality::Candidate& candidate = trade.points[*chosen].candidate;
      VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                    btf::load_material(quality::material_path(request.out, candidate)));
      VENEER_TRY(btf::save_material(*material,
                                    request.material,
                                    {{"fitted_on", run.source},
                                     {"chosen_for", last_name(request.scene)},
                                     {"chosen_as", candidate.name()}}));
      text += fmt::format("\nwrote {}", request.material.string());
    }
  }
  line.print(trade_json(trade, about), text);
  if (!request.has_budget() || chosen) return kExitDone;
  // Not a note: whoever asked for quiet still has to be told why nothing was chosen.
  fmt::print(stderr, "{}\n", chosen.error().what);
  return kExitGateMissed;
}

}  // namespace

Result<int> run_trade(CommandLine& line) {
  TradeRequest request;
  CLI::App& app = line.app();
  app.add_option("set", request.set, "The sample set, NAME.btfset")->required();
  app.add_option("--scene", request.scene, "The scene, scene.toml, with [observer.region]")
      ->required();
  app.add_option("--profile", request.profile, "The projector profile")->required();
  app.add_option("-o,--output",
                 request.out,
                 "The report's folder; a run that was killed goes on in it where it was")
      ->required();
  app.add_option("--grid", request.grid_name, "How much is tried: coarse (minutes) or fine (hours)")
      ->check(CLI::IsMember({"coarse", "fine"}))
      ->capture_default_str();
  app.add_option("--models",
                 request.grid.models,
                 "Only these, with commas; all that the set allows where not given")
      ->delimiter(',');
  app.add_option("--views", request.tools.views, "Places of the observer that are measured from")
      ->capture_default_str();
  app.add_option("--frames", request.tools.frames, "Timed draws of each way to draw")
      ->capture_default_str();
  app.add_option("--pixels", request.tools.pixels, "Pixels compared from each place")
      ->capture_default_str();
  app.add_option("--iterations", request.grid.iterations, "Rounds of clustering at most")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--seed", request.grid.seed, "Seed of everything random")->capture_default_str();
  app.add_option("--budget-ms", request.budget.ms, "Choose what draws in at most this long");
  app.add_option(
      "--budget-mb", request.budget.mb, "Choose what takes at most this much of the GPU's memory");
  app.add_option("--max-de00",
                 request.budget.de00,
                 "Choose what is at most this far off, the mean after compensation; alone, the "
                 "cheapest");
  app.add_option("--material", request.material, "Write the chosen material, NAME.safetensors");
  line.parse();
  VENEER_ASSIGN(request.grid.grid, quality::parse_grid(request.grid_name));
  if (!request.material.empty() && !request.has_budget())
    return fail(Errc::kInvalidOption,
                "--material {}: nothing says which is wanted; add --budget-ms, --budget-mb or "
                "--max-de00",
                request.material.string());
  for (const std::optional<double>& bound :
       {request.budget.ms, request.budget.mb, request.budget.de00})
    if (bound && !(*bound >= 0.0))
      return fail(Errc::kInvalidOption, "a budget of {} is none; give a number from 0 on", *bound);
  return trade(request, line);
}

}  // namespace veneer::cli
