// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_layers.h"

#include <nlohmann/json.hpp>

#include <filesystem>

#include "base/exit_code.h"
#include "base/files.h"
#include "base/parallel.h"
#include "simulation/materials/ring_directions.h"
#include "simulation/recovery/layer_trial.h"

namespace veneer::cli {
namespace {

using simulation::LayerTrial;

// What is asked of the model.
constexpr double kLeastOccupancy = 0.9;
constexpr double kMostNormal_deg = 10.0;
constexpr double kNoises = 2.0;

struct Gates {
  bool occupancy, normals, error, grazing;
  [[nodiscard]] bool all() const { return occupancy && normals && error && grazing; }
};

Gates gates_of(const LayerTrial& trial) {
  return {trial.agreement.occupancy >= kLeastOccupancy,
          trial.agreement.compared > 0 && trial.agreement.normal_median_deg <= kMostNormal_deg,
          trial.layered.rmse <= kNoises * trial.noise + trial.clustered.rmse,
          trial.grazing.layered < trial.grazing.lpca};
}

nlohmann::ordered_json json_of(const simulation::ModelError& error) {
  return {{"model", error.model},
          {"rmse_linear", error.rmse},
          {"bytes_per_texel", error.bytes_per_texel}};
}

nlohmann::ordered_json json_of(std::string_view material, int seed, const LayerTrial& trial) {
  const Gates gates = gates_of(trial);
  return {{"material", material},
          {"seed", seed},
          {"fit_seconds", trial.fit_seconds},
          {"fallback_points", trial.fallback_points},
          {"judged_points", trial.agreement.judged},
          {"occupancy", trial.agreement.occupancy},
          {"occupancy_of_none", trial.agreement.occupancy_of_none},
          {"compared_normals", trial.agreement.compared},
          {"normal_median_deg", trial.agreement.normal_median_deg},
          {"normal_median_of_level_deg", trial.agreement.normal_median_of_level_deg},
          {"noise", trial.noise},
          {"layered", json_of(trial.layered)},
          {"clustered", json_of(trial.clustered)},
          {"grazing_views", trial.grazing.views},
          {"grazing_rmse_layered", trial.grazing.layered},
          {"grazing_rmse_lpca", trial.grazing.lpca},
          {"gates",
           {{"occupancy", gates.occupancy},
            {"normals", gates.normals},
            {"error", gates.error},
            {"grazing", gates.grazing}}}};
}

std::string row_of(std::string_view material, int seed, const LayerTrial& trial) {
  return fmt::format(
      "\n{:<8} {:>4} {:>6.1f} {:>9.1f} {:>6.1f} {:>8.1f} {:>6.1f} {:>8.4f} {:>8.4f} {:>9.4f}  "
      "{:<26} {:>8.4f} {:>8.4f}  {}",
      material,
      seed,
      trial.fit_seconds,
      100.0 * trial.agreement.occupancy,
      100.0 * trial.agreement.occupancy_of_none,
      trial.agreement.normal_median_deg,
      trial.agreement.normal_median_of_level_deg,
      trial.noise,
      trial.layered.rmse,
      trial.clustered.rmse,
      trial.clustered.model,
      trial.grazing.layered,
      trial.grazing.lpca,
      gates_of(trial).all() ? "" : "missed");
}

}  // namespace

Result<int> bench_layers(const BenchLayersOptions& options, CommandLine& line) {
  simulation::LayerTrialOptions trial_options;
  trial_options.size = options.texels;
  trial_options.samples = options.samples;
  VENEER_ASSIGN(trial_options.directions, simulation::ring_directions(options.directions));
  // Never committed, so that nothing is left of the sample sets.
  std::error_code error;
  const std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
  if (error)
    return fail(Errc::kIo, "bench layers: no folder for temporary files: {}", error.message());

  nlohmann::ordered_json trials = nlohmann::ordered_json::array();
  std::string text = fmt::format(
      "{} x {} texels, {} x {} directions, {} threads; occupancy and normals beside what a clear "
      "or a level stack gets\n{:<8} {:>4} {:>6} {:>9} {:>6} {:>8} {:>6} {:>8} {:>8} {:>9}  {:<26} "
      "{:>8} {:>8}",
      options.texels,
      options.texels,
      options.directions,
      options.directions,
      thread_count(),
      "",
      "seed",
      "fit s",
      "matter %",
      "clear",
      "normal",
      "level",
      "noise",
      "layered",
      "clustered",
      "(rmse, of no more bytes)",
      "grazing",
      "lpca");
  bool all = true;
  for (const simulation::BodyMaterial& material : simulation::body_materials()) {
    for (int seed = 1; seed <= options.seeds; ++seed) {
      VENEER_ASSIGN(const StagedFolder folder, StagedFolder::create(temporary / "veneer-layers"));
      trial_options.seed = static_cast<std::uint64_t>(seed);
      VENEER_ASSIGN(
          const LayerTrial trial,
          simulation::try_layers(material, trial_options, folder.path(), line.progress()));
      trials.push_back(json_of(material.name, seed, trial));
      text += row_of(material.name, seed, trial);
      all = all && gates_of(trial).all();
    }
  }
  line.print({{"texels", options.texels},
              {"directions", options.directions},
              {"samples", options.samples},
              {"threads", thread_count()},
              {"trials", trials},
              {"gates_met", all}},
             text);
  return options.gate && !all ? kExitGateMissed : kExitDone;
}

}  // namespace veneer::cli
