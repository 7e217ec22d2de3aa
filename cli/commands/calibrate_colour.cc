// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/calibrate_colour.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>

#include "base/exit_code.h"
#include "calibration/colour/baking.h"
#include "calibration/colour/inverse.h"
#include "calibration/colour/ramps.h"
#include "calibration/colour/selection.h"
#include "calibration/exchange/cgats.h"
#include "calibration/exchange/cube.h"
#include "calibration/exchange/icc.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using calibration::PatchReading;
using nlohmann::ordered_json;

/// Every so many of the mixtures are held out where no other readings are given to check with.
constexpr int kHoldOutEvery = 3;

struct Split {
  std::vector<PatchReading> fitted;
  std::vector<PatchReading> held_out;
};

/// Single channels and white make the fit; of the other mixtures some are kept back.
Split split(const std::vector<PatchReading>& readings) {
  Split result;
  int mixtures = 0;
  for (const PatchReading& reading : readings) {
    const bool mixture = (reading.drive.array() > 0).count() > 1 && !reading.drive.isOnes();
    const bool out = mixture && mixtures++ % kHoldOutEvery == 0;
    (out ? result.held_out : result.fitted).push_back(reading);
  }
  return result;
}

ordered_json json_of(const calibration::ColourCandidate& candidate) {
  ordered_json json{{"name", candidate.name}, {"fitted", candidate.fitted}};
  if (!candidate.fitted) {
    json["refusal"] = candidate.refusal;
    return json;
  }
  json["parameters"] = candidate.parameters;
  json["de00_mean"] = candidate.held_out.mean;
  json["de00_p95"] = candidate.held_out.p95;
  json["de00_max"] = candidate.held_out.max;
  return json;
}

/// sRGB to drives, its white the brightest that the projector reaches; what cannot be shown keeps
/// its hue.
Result<calibration::CubeTable> srgb_table(const calibration::ColourModel& model, const Xyz& black) {
  constexpr int kNodes = 33;
  VENEER_ASSIGN(const calibration::ColourInverse inverse,
                calibration::ColourInverse::make(model, black));
  const Xyz white = xyz_from_srgb() * Eigen::Vector3d::Ones();
  double low = 0;
  double high = 4 * model.forward(Eigen::Vector3d::Ones()).y();
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (inverse(middle * white - black).in_gamut ? low : high) = middle;
  }
  calibration::CubeTable table =
      calibration::CubeTable::sampled(kNodes, [&](const Eigen::Vector3d& rgb) {
        const Eigen::Vector3d linear = rgb.unaryExpr([](double v) { return srgb_decode(v); });
        const Xyz relative = xyz_from_srgb() * linear;
        return inverse(low * relative - relative.y() * black).drive;
      });
  table.title = "sRGB to projector drive";
  return table;
}

}  // namespace

Result<int> calibrate_colour(CommandLine& line) {
  std::string sub_command;  // "colour"
  fs::path readings_path;
  fs::path held_out_path;
  fs::path icc;
  fs::path cube;
  CLI::App& app = line.app();
  app.add_option("colour", sub_command)->required();
  app.add_option("readings", readings_path, "Readings of patches, a .ti3")->required();
  app.add_option("--held-out",
                 held_out_path,
                 "Other readings, by which a model is chosen (default: a third of the mixtures)");
  app.add_option("--icc", icc, "Write an ICC profile of the model that is chosen");
  app.add_option(
      "--cube", cube, "Write a look-up table, .cube, that makes the projector show sRGB");
  line.parse();

  VENEER_ASSIGN(const calibration::MeasuredPatches measured, calibration::read_ti3(readings_path));
  const auto is_black = [](const PatchReading& reading) { return reading.drive.isZero(0); };
  if (std::ranges::none_of(measured.patches, is_black))
    return fail(Errc::kBadFormat,
                "fitting colour models: black was not read; measure it, better several times");
  const Xyz black = calibration::mean_black(measured.patches);
  Split parts{measured.patches, {}};
  if (held_out_path.empty()) {
    parts = split(measured.patches);
  } else {
    VENEER_ASSIGN(calibration::MeasuredPatches other, calibration::read_ti3(held_out_path));
    parts.held_out = std::move(other.patches);
  }
  // Where no channel was read alone at a mixture's drives nothing is known of it: all may try.
  calibration::Additivity additivity;
  if (auto tested = calibration::test_additivity(measured.patches, black)) {
    additivity = std::move(*tested);
  } else {
    additivity.decisive = false;
    additivity.reason = tested.error().what;
  }
  VENEER_ASSIGN(const calibration::SelectedColour selected,
                calibration::select_colour_model(parts.fitted, parts.held_out, black, additivity));
  if (!icc.empty()) {
    constexpr int kBits = 10;  // of the curves in the profile
    VENEER_ASSIGN(const calibration::BakedColour baked, calibration::bake(*selected.model, kBits));
    calibration::IccSource source;
    source.tone_curves = baked.tone_curves;
    source.primaries = baked.primaries;
    if (!baked.residual.empty())
      source.forward = [&](const Eigen::Vector3d& drive) {
        return Xyz(selected.model->forward(drive) + black);
      };
    VENEER_TRY(calibration::write_icc(icc, source));
  }

  if (!cube.empty()) {
    VENEER_ASSIGN(const calibration::CubeTable table, srgb_table(*selected.model, black));
    VENEER_TRY(calibration::write_cube(cube, table));
  }

  ordered_json json{{"model", selected.model->name()},
                    {"reason", selected.reason},
                    {"patches", parts.fitted.size()},
                    {"held_out", parts.held_out.size()},
                    {"additive", additivity.additive},
                    {"candidates", ordered_json::array()}};
  std::string text =
      fmt::format("{:<16}{:>11}{:>8}{:>8}{:>8}", "model", "parameters", "mean", "95 %", "most");
  for (const calibration::ColourCandidate& candidate : selected.candidates) {
    json["candidates"].push_back(json_of(candidate));
    text += candidate.fitted ? fmt::format("\n{:<16}{:>11}{:>8.2f}{:>8.2f}{:>8.2f}",
                                           candidate.name,
                                           candidate.parameters,
                                           candidate.held_out.mean,
                                           candidate.held_out.p95,
                                           candidate.held_out.max)
                             : fmt::format("\n{:<16} {}", candidate.name, candidate.refusal);
  }
  line.print(json, text + "\n" + selected.reason);
  return kExitDone;
}

}  // namespace veneer::cli
