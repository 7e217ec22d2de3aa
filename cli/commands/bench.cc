// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <optional>

#include "base/exit_code.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "cli/commands/bench_fit.h"
#include "cli/commands/commands.h"
#include "render/benchmark.h"
#include "simulation/materials/synthesize.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

/// Removes the benchmark's sample set when it is done with.
class ScratchFolder {
 public:
  explicit ScratchFolder(const fs::path& parent)
      : path_(parent / fmt::format("veneer-bench-{}", ::getpid())) {}
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

struct Candidate {
  std::string_view model;
  std::string_view components;
};
constexpr int kIterations = 60;      // where errors count
constexpr int kRoughIterations = 5;  // where only times do
constexpr std::array kCandidates{
    Candidate{"lpca", "2"},
    Candidate{"lpca", "4"},
    Candidate{"lpca", "8"},
    Candidate{"dichromatic-lpca", "2+2"},
    Candidate{"dichromatic-lpca", "4+4"},
    Candidate{"texel-colours", "3+1"},
    Candidate{"texel-colours", "6+2"},
};

/// Every model that the set allows at the sizes of the literature, each also with the cache where
/// it offers one and one is asked for.
Result<std::vector<render::RenderBenchMaterial>> fit_candidates(
    const btf::SampleSet& set,
    int iterations,
    const render::AngularCacheOptions& cache,
    Progress& progress) {
  std::vector<render::RenderBenchMaterial> materials;
  for (const Candidate& candidate : kCandidates) {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(candidate.model));
    if (model->polarised && !set.info().polarised) continue;
    btf::FitOptions options;
    if (!candidate.components.empty()) options.components = candidate.components;
    options.iterations = iterations;
    VENEER_ASSIGN(std::unique_ptr<btf::Material> fitted, model->fit(set, options, progress));
    const std::shared_ptr<const btf::Material> material = std::move(fitted);
    const std::string name = fmt::format("{} {}", candidate.model, candidate.components);
    materials.push_back({name, material});
    if (cache.spacing > 0 && material->shader().cache)
      materials.push_back({name + " cached", material, cache});
  }
  return materials;
}

/// A small cloth, for what a pixel costs depends on sizes and access patterns, hardly on what the
/// numbers are.
Result<btf::SampleSet> synthesize_cloth(const fs::path& path, Progress& progress) {
  VENEER_ASSIGN(const simulation::HeightFieldMaterial* cloth,
                simulation::find_height_field_material("cloth"));
  simulation::SynthesisOptions synthesis;
  synthesis.size = 32;
  synthesis.samples = 1;
  synthesis.bounces = 1;
  VENEER_TRY(simulation::synthesize(*cloth, path, synthesis, progress));
  return btf::SampleSet::open(path);
}

}  // namespace

Result<int> run_bench(CommandLine& line) {
  std::string what;
  std::string size = "1024x768";
  std::vector<fs::path> files;
  fs::path set_path;
  render::RenderBenchOptions options;
  render::AngularCacheOptions cache;
  CLI::App& app = line.app();
  app.add_option(
         "what",
         what,
         "render: what drawing a frame costs with each model; fit: what finding clusters in "
         "a basis gains")
      ->required()
      ->check(CLI::IsMember({"fit", "render"}));
  fs::path fitted_set;
  std::string model_name = "lpca";
  btf::FitOptions fit;
  app.add_option("samples", fitted_set, "fit: the sample set, NAME.btfset");
  app.add_option("--model", model_name, "fit: a clustered model")->capture_default_str();
  app.add_option("--clusters", fit.clusters, "fit: clusters of texels")->capture_default_str();
  app.add_option("--components", fit.components, "fit: Eigen-BRDFs per texel")
      ->capture_default_str();
  app.add_option("--seed", fit.seed, "fit: seed of everything random")->capture_default_str();
  app.add_option("--size", size, "Pixels, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--frames", options.frames, "Draws of each")->capture_default_str();
  app.add_option(
      "--material", files, "Time these materials, NAME.safetensors, in place of a fixed list");
  app.add_option("--set",
                 set_path,
                 "Fit the fixed list to this sample set, and compare what is drawn with it");
  app.add_option("--cache",
                 cache.spacing,
                 "Time each with an angular cache too, with this many pixels between nodes");
  app.add_option("--cache-turn", cache.most_turn, "The most that directions may turn between nodes")
      ->capture_default_str();
  line.parse();
  if (what == "fit") {
    if (fitted_set.empty())
      return fail(Errc::kInvalidOption, "bench fit: name a sample set, NAME.btfset");
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(model_name));
    return bench_fit(fitted_set, *model, fit, line);
  }
  if (!fitted_set.empty())
    return fail(Errc::kInvalidOption, "bench {}: it takes no sample set", what);
  if (char rest = 0;
      std::sscanf(size.c_str(), "%dx%d%c", &options.width, &options.height, &rest) != 2) {
    return fail(Errc::kInvalidOption, "--size {}: expected WIDTHxHEIGHT, such as 1024x768", size);
  }

  VENEER_TRY(cache.check());
  std::error_code error;
  const fs::path temporary = fs::temp_directory_path(error);
  if (error)
    return fail(
        Errc::kIo, "looking for a folder for temporary files: {}; set TMPDIR", error.message());
  const ScratchFolder scratch(temporary);
  std::optional<btf::InterpolatedSet> reference;
  if (!set_path.empty()) {
    VENEER_ASSIGN(btf::SampleSet set, btf::SampleSet::open(set_path));
    reference.emplace(std::move(set));
    options.reference = &*reference;
  }
  for (const fs::path& file : files) {
    VENEER_ASSIGN(std::unique_ptr<btf::Material> fitted, btf::load_material(file));
    const std::shared_ptr<const btf::Material> material = std::move(fitted);
    options.materials.push_back({file.stem().string(), material});
    if (cache.spacing > 0 && material->shader().cache)
      options.materials.push_back({file.stem().string() + " cached", material, cache});
  }
  if (files.empty() && reference) {
    VENEER_ASSIGN(options.materials,
                  fit_candidates(reference->set(), kIterations, cache, line.progress()));
  } else if (files.empty()) {
    VENEER_ASSIGN(const btf::SampleSet set,
                  synthesize_cloth(scratch.path() / "cloth.btfset", line.progress()));
    VENEER_ASSIGN(options.materials, fit_candidates(set, kRoughIterations, cache, line.progress()));
  }
  VENEER_ASSIGN(const render::RenderBenchResult result,
                render::bench_render(options, line.progress()));
  nlohmann::ordered_json json{
      {"renderer", result.renderer}, {"clock", result.clock}, {"size", size}};
  std::string table = fmt::format("{}, {} ({})\n{:<28} {:>8} {:>8} {:>7} {:>8} {:>9} {:>9} {:>7}",
                                  result.renderer,
                                  size,
                                  result.clock,
                                  "",
                                  "ms",
                                  "p95",
                                  "ratio",
                                  "fetches",
                                  "MB",
                                  "epsilon",
                                  "cached");
  for (const render::RenderTiming& t : result.timings) {
    json["results"].push_back({{"name", t.name},
                               {"ms_median", t.ms_median},
                               {"ms_p95", t.ms_p95},
                               {"ratio", t.ratio},
                               {"fetches", t.fetches},
                               {"gpu_bytes", t.gpu_bytes}});
    if (t.served) json["results"].back()["served"] = *t.served;
    if (t.screen_epsilon) json["results"].back()["screen_epsilon"] = *t.screen_epsilon;
    if (t.screen_rmse) json["results"].back()["screen_rmse"] = *t.screen_rmse;
    table += fmt::format("\n{:<28} {:>8.2f} {:>8.2f} {:>7.2f} {:>8} {:>9.1f} {:>9} {:>7}",
                         t.name,
                         t.ms_median,
                         t.ms_p95,
                         t.ratio,
                         t.fetches,
                         static_cast<double>(t.gpu_bytes) / 1e6,
                         t.screen_epsilon ? fmt::format("{:.4f}", *t.screen_epsilon) : "",
                         t.served ? fmt::format("{:.0f} %", 100 * *t.served) : "");
  }
  line.print(json, table);
  return kExitDone;
}

}  // namespace veneer::cli
