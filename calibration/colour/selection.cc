// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/selection.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/statistics.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

std::vector<PatchReading> without(std::span<const PatchReading> readings,
                                  std::span<const PatchReading> fitted) {
  std::vector<PatchReading> rest;
  for (const PatchReading& reading : readings) {
    const bool seen = std::ranges::any_of(
        fitted, [&reading](const PatchReading& patch) { return patch.drive == reading.drive; });
    if (!seen) rest.push_back(reading);
  }
  return rest;
}

// The mean reading of one drive; nothing where it was not read.
std::optional<Xyz> mean_reading(const Eigen::Vector3d& drive,
                                std::span<const PatchReading> first,
                                std::span<const PatchReading> second) {
  Xyz sum = Xyz::Zero();
  int count = 0;
  for (const std::span<const PatchReading> readings : {first, second}) {
    for (const PatchReading& reading : readings) {
      if (reading.drive != drive) continue;
      sum += reading.xyz;
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

// Black alone if there is neither white nor all channels: no family can be fitted then.
Xyz white_of(std::span<const PatchReading> fitted,
             std::span<const PatchReading> held_out,
             const Xyz& black) {
  if (const auto white = mean_reading(Eigen::Vector3d::Ones(), fitted, held_out)) return *white;
  Xyz white = black;
  for (Eigen::Index c = 0; c < 3; ++c) {
    if (const auto full = mean_reading(Eigen::Vector3d::Unit(c), fitted, {}))
      white += *full - black;
  }
  return white;
}

}  // namespace

ColourError colour_error(const ColourModel& model,
                         std::span<const PatchReading> readings,
                         const Xyz& black,
                         const Xyz& white) {
  std::vector<double> differences;
  for (const PatchReading& reading : readings)
    differences.push_back(delta_e_2000(lab_from_xyz(model.forward(reading.drive) + black, white),
                                       lab_from_xyz(reading.xyz, white)));
  if (differences.empty()) return {};
  return {static_cast<int>(differences.size()),
          mean(differences),
          quantile(differences, 0.95),
          *std::ranges::max_element(differences)};
}

Result<SelectedColour> select_colour_model(std::span<const PatchReading> fitted,
                                           std::span<const PatchReading> held_out,
                                           const Xyz& black,
                                           const Additivity& additivity) {
  const std::vector<PatchReading> unseen = without(held_out, fitted);
  if (unseen.empty())
    return fail(Errc::kBadFormat,
                "choosing a colour model: no reading is left that was not used for a fit; measure "
                "the patches of verification_patches()");
  for (const PatchReading& reading : unseen) {
    if (!reading.drive.allFinite() || !reading.xyz.allFinite())
      return fail(Errc::kBadFormat,
                  "choosing a colour model: a reading to verify with is not finite; read it again");
  }
  const Xyz white = white_of(fitted, held_out, black);
  SelectedColour result;
  std::vector<std::unique_ptr<ColourModel>> models;
  const bool only_interaction = additivity.decisive && !additivity.additive;
  for (const ColourModelFamily& family : colour_model_families()) {
    ColourCandidate candidate;
    candidate.name = family.name;
    candidate.patches = count_drives(fitted);
    models.emplace_back();
    if (only_interaction && !family.models_interaction) {
      candidate.refusal = additivity.reason;
    } else if (auto model = family.fit(fitted, black)) {
      candidate.fitted = true;
      candidate.parameters = (*model)->parameters();
      candidate.held_out = colour_error(**model, unseen, black, white);
      models.back() = std::move(*model);
    } else {
      candidate.refusal = model.error().what;
    }
    result.candidates.push_back(std::move(candidate));
  }
  double least = HUGE_VAL;
  for (const ColourCandidate& candidate : result.candidates) {
    if (candidate.fitted) least = std::min(least, candidate.held_out.mean);
  }
  const ColourCandidate* chosen = nullptr;
  for (const ColourCandidate& candidate : result.candidates) {
    if (!candidate.fitted || candidate.held_out.mean > least + kWorthMoreParameters) continue;
    if (chosen == nullptr || candidate.parameters < chosen->parameters) chosen = &candidate;
  }
  if (chosen == nullptr)
    return fail(Errc::kBadFormat,
                "choosing a colour model: none could be fitted; {}: {}",
                result.candidates.front().name,
                result.candidates.front().refusal);
  result.model = std::move(models[static_cast<std::size_t>(chosen - result.candidates.data())]);
  result.reason = fmt::format(
      "{}: dE00 {:.2f} on average and {:.2f} at most over {} patches that no fit saw, the fewest "
      "parameters ({}) within {} of the best ({:.2f}); {}",
      chosen->name,
      chosen->held_out.mean,
      chosen->held_out.max,
      chosen->held_out.patches,
      chosen->parameters,
      kWorthMoreParameters,
      least,
      additivity.reason);
  return result;
}

}  // namespace veneer::calibration
