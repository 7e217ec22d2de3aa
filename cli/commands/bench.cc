// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <array>
#include <cstdio>

#include "base/exit_code.h"
#include "btf/material.h"
#include "btf/sample_set.h"
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
constexpr std::array kCandidates{
    Candidate{"lpca", "2"},
    Candidate{"lpca", "4"},
    Candidate{"lpca", "8"},
    Candidate{"dichromatic-lpca", "2+2"},
    Candidate{"dichromatic-lpca", "4+4"},
    Candidate{"texel-colours", "3+1"},
    Candidate{"texel-colours", "6+2"},
};

/// Every model at the sizes of the literature, fitted to a small synthetic cloth: what a pixel
/// costs depends on sizes and access patterns, hardly on what the numbers are.
Result<std::vector<render::RenderBenchMaterial>> fit_candidates(Progress& progress) {
  std::error_code error;
  const fs::path temporary = fs::temp_directory_path(error);
  if (error)
    return fail(
        Errc::kIo, "looking for a folder for temporary files: {}; set TMPDIR", error.message());
  const ScratchFolder scratch(temporary);
  const fs::path path = scratch.path() / "cloth.btfset";
  VENEER_ASSIGN(const simulation::HeightFieldMaterial* cloth,
                simulation::find_height_field_material("cloth"));
  simulation::SynthesisOptions synthesis;
  synthesis.size = 32;
  synthesis.samples = 1;
  synthesis.bounces = 1;
  VENEER_TRY(simulation::synthesize(*cloth, path, synthesis, progress));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(path));
  std::vector<render::RenderBenchMaterial> materials;
  for (const Candidate& candidate : kCandidates) {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(candidate.model));
    btf::FitOptions options;
    options.components = candidate.components;
    options.iterations = 5;
    VENEER_ASSIGN(std::unique_ptr<btf::Material> material, model->fit(set, options, progress));
    materials.push_back(
        {fmt::format("{} {}", candidate.model, candidate.components), std::move(material)});
  }
  return materials;
}

}  // namespace

Result<int> run_bench(CommandLine& line) {
  std::string what;
  std::string size = "1024x768";
  std::vector<fs::path> files;
  render::RenderBenchOptions options;
  CLI::App& app = line.app();
  app.add_option("what", what, "render: what drawing a frame costs with each model")
      ->required()
      ->check(CLI::IsMember({"render"}));
  app.add_option("--size", size, "Pixels, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--frames", options.frames, "Draws of each")->capture_default_str();
  app.add_option(
      "--material", files, "Time these materials, NAME.safetensors, in place of a fixed list");
  line.parse();
  if (char rest = 0;
      std::sscanf(size.c_str(), "%dx%d%c", &options.width, &options.height, &rest) != 2) {
    return fail(Errc::kInvalidOption, "--size {}: expected WIDTHxHEIGHT, such as 1024x768", size);
  }

  for (const fs::path& file : files) {
    VENEER_ASSIGN(std::unique_ptr<btf::Material> material, btf::load_material(file));
    options.materials.push_back({file.stem().string(), std::move(material)});
  }
  if (files.empty()) {
    VENEER_ASSIGN(options.materials, fit_candidates(line.progress()));
  }
  VENEER_ASSIGN(const render::RenderBenchResult result,
                render::bench_render(options, line.progress()));
  nlohmann::ordered_json json{
      {"renderer", result.renderer}, {"clock", result.clock}, {"size", size}};
  std::string table = fmt::format("{}, {} ({})\n{:<24} {:>8} {:>8} {:>7} {:>8} {:>9}",
                                  result.renderer,
                                  size,
                                  result.clock,
                                  "",
                                  "ms",
                                  "p95",
                                  "ratio",
                                  "fetches",
                                  "MB");
  for (const render::RenderTiming& t : result.timings) {
    json["results"].push_back({{"name", t.name},
                               {"ms_median", t.ms_median},
                               {"ms_p95", t.ms_p95},
                               {"ratio", t.ratio},
                               {"fetches", t.fetches},
                               {"gpu_bytes", t.gpu_bytes}});
    table += fmt::format("\n{:<24} {:>8.2f} {:>8.2f} {:>7.2f} {:>8} {:>9.1f}",
                         t.name,
                         t.ms_median,
                         t.ms_p95,
                         t.ratio,
                         t.fetches,
                         static_cast<double>(t.gpu_bytes) / 1e6);
  }
  line.print(json, table);
  return kExitDone;
}

}  // namespace veneer::cli
