// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_colour.h"

#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "calibration/colour/ladder.h"

namespace veneer::cli {
namespace {

using calibration::ColourError;
using calibration::LadderResult;

nlohmann::ordered_json json_of(const ColourError& error) {
  return {{"mean", error.mean}, {"p95", error.p95}, {"max", error.max}};
}

nlohmann::ordered_json json_of(const LadderResult& rung, bool in_gate) {
  nlohmann::ordered_json models = nlohmann::ordered_json::array();
  for (const calibration::ColourCandidate& model : rung.models)
    models.push_back({{"name", model.name},
                      {"patches", model.patches},
                      {"parameters", model.parameters},
                      {"de00", json_of(model.held_out)}});
  return {{"defect", rung.defect},
          {"ramp_patches", rung.ramp_patches},
          {"interaction_patches", rung.interaction_patches},
          {"additivity_error", rung.additivity_error},
          {"additive_draws", rung.additive_verdicts},
          {"models", std::move(models)},
          {"chosen", rung.chosen},
          {"chosen_de00", json_of(rung.chosen_error)},
          {"in_gate", in_gate}};
}

std::string text_of(const LadderResult& rung) {
  std::string text = fmt::format("\n\n{}, {} patches (+{} for interaction), additivity {:+.1f} %",
                                 rung.defect,
                                 rung.ramp_patches,
                                 rung.interaction_patches,
                                 100 * rung.additivity_error);
  const auto row = [&text](std::string_view name, const ColourError& error) {
    text += fmt::format(
        "\n  {:<15} {:>5.2f} {:>5.2f} {:>5.2f}", name, error.mean, error.p95, error.max);
  };
  for (const calibration::ColourCandidate& model : rung.models) row(model.name, model.held_out);
  row("chosen", rung.chosen_error);
  return text + "  " + rung.chosen;
}

bool is_in_gate(const LadderResult& rung) {
  constexpr int kGatePatches = 52;
  if (rung.ramp_patches < kGatePatches) return true;
  const double allowed = rung.additive_verdicts == calibration::kLadderDraws ? 1.0 : 2.0;
  const ColourError& error = rung.chosen_error;
  return error.mean <= 0.5 * allowed && error.p95 <= allowed && error.max <= 2.0 * allowed;
}

}  // namespace

Result<int> bench_colour(CommandLine& line) {
  nlohmann::ordered_json rungs = nlohmann::ordered_json::array();
  std::string text =
      fmt::format("dE00 over {} colours, {} % noise, means of {} draws: mean, 95 %, max",
                  calibration::kLadderColours,
                  100 * calibration::kLadderNoise,
                  calibration::kLadderDraws);
  bool all_in_gate = true;
  for (const calibration::LadderRung& rung : calibration::ladder_rungs()) {
    VENEER_ASSIGN(const LadderResult result, calibration::climb(rung));
    const bool in_gate = is_in_gate(result);
    all_in_gate = all_in_gate && in_gate;
    rungs.push_back(json_of(result, in_gate));
    text += text_of(result) + (in_gate ? "" : "  MISSES ITS GATE");
  }
  line.print({{"noise", calibration::kLadderNoise},
              {"colours", calibration::kLadderColours},
              {"draws", calibration::kLadderDraws},
              {"rungs", std::move(rungs)},
              {"in_gate", all_in_gate}},
             text);
  return all_in_gate ? kExitDone : kExitGateMissed;
}

}  // namespace veneer::cli
