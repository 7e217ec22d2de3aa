// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_colour.h"
#include "cli/commands/bench_fit.h"
#include "cli/commands/bench_governor.h"
#include "cli/commands/bench_latency.h"
#include "cli/commands/bench_layers.h"
#include "cli/commands/bench_query.h"
#include "cli/commands/bench_render.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_bench(CommandLine& line) {
  std::string what;
  std::filesystem::path set;
  BenchRenderOptions render;
  std::string evaluation = "fragment";
  std::string model_name = "lpca";
  btf::FitOptions fit;
  BenchGovernorOptions governor;
  BenchLatencyOptions latency;
  BenchLayersOptions layers;
  CLI::App& app = line.app();
  app.add_option(
         "what",
         what,
         "render: what drawing a frame costs with each model; fit: what finding clusters in "
         "a basis gains; query: what asking for a pose costs; colour: how far each colour model is "
         "from invented projectors; latency: where the time from a pose to its light goes; "
         "governor: how the deadline is held while a load comes and goes; layers: what layered "
         "gives "
         "back of traced materials whose geometry is known")
      ->required()
      ->check(CLI::IsMember({"colour", "fit", "governor", "latency", "layers", "query", "render"}));
  app.add_option("set",
                 set,
                 "The sample set, NAME.btfset; render takes a small synthetic one by itself, and "
                 "compares what is drawn with a given one");
  CLI::Option* size = app.add_option("--size",
                                     render.size,
                                     "render: pixels, WIDTHxHEIGHT; latency: "
                                     "likewise, 320x240 by itself; governor: 128x96");
  size->capture_default_str();
  app.add_option("--frames", render.frames, "render: draws of each")->capture_default_str();
  app.add_option("--material",
                 render.materials,
                 "render: time these materials, NAME.safetensors, in place of a fixed list");
  app.add_option("--texels-per-pixel",
                 render.texels_per_pixel,
                 "render: how many texels fall along a pixel's side")
      ->capture_default_str();
  app.add_option("--rays",
                 render.rays,
                 "render: what is drawn is compared with the mean of so many rays along each side "
                 "of a pixel; 1 is the texel at its centre")
      ->capture_default_str();
  app.add_flag("--average", render.average, "render: time each with averaged texels too");
  app.add_option("--evaluation",
                 evaluation,
                 "render: compute times each evaluated in a compute pass too; fragment does not")
      ->capture_default_str();
  app.add_option(
         "--scale", render.scale, "render: time each on a raster this much smaller too, 0.25 to 1")
      ->capture_default_str();
  app.add_option("--cache",
                 render.cache.spacing,
                 "render: time each with an angular cache too, so many pixels between nodes");
  app.add_option("--cache-turn",
                 render.cache.most_turn,
                 "render: the most that directions may turn between nodes")
      ->capture_default_str();
  app.add_option("--model", model_name, "fit: a clustered model")->capture_default_str();
  app.add_option("--clusters", fit.clusters, "fit: clusters of texels")->capture_default_str();
  app.add_option("--components", fit.components, "fit: Eigen-BRDFs per texel")
      ->capture_default_str();
  app.add_option("--seed", fit.seed, "fit: seed of everything random")->capture_default_str();
  CLI::Option* seconds = app.add_option("--seconds",
                                        latency.seconds,
                                        "latency: how long veneerd runs; governor: a third before "
                                        "the load, one under it and one after it, 30 by itself")
                             ->capture_default_str()
                             ->check(CLI::Range(2.0, 3600.0));
  app.add_option("--tracker-hz", latency.tracker_hz, "latency: poses a second")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 10000.0));
  CLI::Option* frame_hz =
      app.add_option("--frame-hz",
                     latency.frame_hz,
                     "latency: frames a second; governor: likewise, 20 by itself")
          ->capture_default_str()
          ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--busy",
                 governor.busy_threads,
                 "governor: threads of the load; 0: one for each processor")
      ->capture_default_str()
      ->check(CLI::Range(0, 256));
  app.add_flag("--gate", governor.gate, "governor, layers: exit with 3 where a gate is missed");
  app.add_option("--texels", layers.texels, "layers: texels along each side")
      ->capture_default_str();
  app.add_option("--directions", layers.directions, "layers: directions of view, and of light")
      ->capture_default_str();
  app.add_option("--samples", layers.samples, "layers: paths per texel and view")
      ->capture_default_str();
  app.add_option("--seeds", layers.seeds, "layers: materials of each kind")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  line.parse();
  if (what == "render") {
    render.set = set;
    VENEER_ASSIGN(render.evaluation, render::parse_evaluation(evaluation));
    return bench_render(render, line);
  }
  if (what == "colour") return bench_colour(line);
  if (what == "governor") {
    if (size->count() > 0) governor.size = render.size;
    if (seconds->count() > 0) governor.seconds = latency.seconds;
    if (frame_hz->count() > 0) governor.frame_hz = latency.frame_hz;
    return bench_governor(governor, line);
  }
  if (what == "latency") {
    if (size->count() > 0) latency.size = render.size;
    return bench_latency(latency, line);
  }
  if (what == "layers") {
    layers.gate = governor.gate;
    return bench_layers(layers, line);
  }
  if (what == "query") return bench_query(line);
  if (set.empty()) return fail(Errc::kInvalidOption, "bench fit: name a sample set, NAME.btfset");
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(model_name));
  return bench_fit(set, *model, fit, line);
}

}  // namespace veneer::cli
