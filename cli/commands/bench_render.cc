// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_render.h"

#include <nlohmann/json.hpp>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/exit_code.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "cli/picture_size.h"
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
  int layers = 0;
};
constexpr int kIterations = 60;      // where errors count
constexpr int kRoughIterations = 5;  // where only times do
constexpr std::array kCandidates{
    Candidate{"phong", ""},
    Candidate{"lafortune", ""},
    Candidate{"eigen-texture", "16"},
    Candidate{"lpca", "2"},
    Candidate{"lpca", "4"},
    Candidate{"lpca", "8"},
    Candidate{"revised-lpca", "2"},
    Candidate{"revised-lpca", "4"},
    Candidate{"revised-lpca", "8"},
    Candidate{"dichromatic-lpca", "2+2"},
    Candidate{"dichromatic-lpca", "4+4"},
    Candidate{"texel-colours", "3+1"},
    Candidate{"texel-colours", "6+2"},
    Candidate{"layered", "", 2},
    Candidate{"layered", "", 4},
};

/// A material, and once more in every way that it offers and that is asked for.
void add(const std::string& name,
         const std::shared_ptr<const btf::Material>& material,
         const BenchRenderOptions& options,
         std::vector<render::RenderBenchMaterial>& materials) {
  const bool cached = options.cache.spacing > 0 && material->shader().cache;
  const bool compute = options.evaluation == render::Evaluation::kCompute;
  for (const bool average : {false, true}) {
    if (average && !options.average) break;
    const std::string shown = average ? name + " averaged" : name;
    materials.push_back({shown, material, {}, average});
    if (options.scale != 1)
      materials.push_back({.name = fmt::format("{} scale {}", shown, options.scale),
                           .material = material,
                           .average_texels = average,
                           .scale = options.scale});
    if (cached) materials.push_back({shown + " cached", material, options.cache, average});
    if (compute)
      materials.push_back(
          {shown + " compute", material, {}, average, render::Evaluation::kCompute});
  }
}

/// Every model that the set allows at the sizes of the literature.
Result<std::vector<render::RenderBenchMaterial>> fit_candidates(const btf::SampleSet& set,
                                                                int iterations,
                                                                const BenchRenderOptions& how,
                                                                Progress& progress) {
  std::vector<render::RenderBenchMaterial> materials;
  for (const Candidate& candidate : kCandidates) {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(candidate.model));
    if (model->polarised && !set.info().polarised) continue;
    btf::FitOptions options;
    if (!candidate.components.empty()) options.components = candidate.components;
    options.iterations = iterations;
    options.layers = candidate.layers;
    VENEER_ASSIGN(std::unique_ptr<btf::Material> fitted, model->fit(set, options, progress));
    const std::shared_ptr<const btf::Material> material = std::move(fitted);
    std::string name(candidate.model);
    if (!candidate.components.empty()) name += fmt::format(" {}", candidate.components);
    if (candidate.layers > 0) name += fmt::format(" {} layers", candidate.layers);
    add(name, material, how, materials);
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

void print(const render::RenderBenchResult& result, const std::string& size, CommandLine& line) {
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
}

}  // namespace

Result<int> bench_render(const BenchRenderOptions& options, CommandLine& line) {
  render::RenderBenchOptions bench;
  bench.frames = options.frames;
  bench.texels_per_pixel = options.texels_per_pixel;
  bench.reference_rays = options.rays;
  VENEER_ASSIGN(const PictureSize size, parse_size(options.size));
  bench.width = size.width;
  bench.height = size.height;
  VENEER_TRY(options.cache.check());
  for (const fs::path& file : options.materials) {
    VENEER_ASSIGN(std::unique_ptr<btf::Material> fitted, btf::load_material(file));
    add(file.stem().string(), std::move(fitted), options, bench.materials);
  }
  std::optional<btf::InterpolatedSet> reference;
  if (!options.set.empty()) {
    VENEER_ASSIGN(btf::SampleSet set, btf::SampleSet::open(options.set));
    reference.emplace(std::move(set));
    bench.reference = &*reference;
    if (bench.materials.empty()) {
      VENEER_ASSIGN(bench.materials,
                    fit_candidates(reference->set(), kIterations, options, line.progress()));
    }
  } else if (bench.materials.empty()) {
    std::error_code error;
    const fs::path temporary = fs::temp_directory_path(error);
    if (error)
      return fail(
          Errc::kIo, "looking for a folder for temporary files: {}; set TMPDIR", error.message());
    const ScratchFolder scratch(temporary);
    VENEER_ASSIGN(const btf::SampleSet set,
                  synthesize_cloth(scratch.path() / "cloth.btfset", line.progress()));
    VENEER_ASSIGN(bench.materials, fit_candidates(set, kRoughIterations, options, line.progress()));
  }
  VENEER_ASSIGN(const render::RenderBenchResult result,
                render::bench_render(bench, line.progress()));
  print(result, options.size, line);
  return kExitDone;
}

}  // namespace veneer::cli
