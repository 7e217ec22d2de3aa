// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/ladder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "base/random.h"
#include "calibration/colour/additivity.h"
#include "calibration/colour/colour_patches.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

constexpr int kBits = 8;

Xyz xyz_of(double x, double y, double luminance) { return luminance / y * Xyz(x, y, 1.0 - x - y); }

// cd/m^2 at full drive.
const std::array<Xyz, 3>& primaries() {
  static const std::array<Xyz, 3> kPrimaries{
      xyz_of(0.645, 0.335, 62.0), xyz_of(0.305, 0.635, 205.0), xyz_of(0.147, 0.058, 23.0)};
  return kPrimaries;
}

Vector3d tones(const Vector3d& drive) {
  constexpr std::array kExponents{2.25, 2.20, 2.10};
  constexpr std::array kShares{0.25, 0.20, 0.15};  // of the S in the curve
  Vector3d linear;
  for (Eigen::Index c = 0; c < 3; ++c) {
    const double d = drive[c];
    const double s = d * d * (3.0 - 2.0 * d);
    const auto i = static_cast<std::size_t>(c);
    linear[c] = (1.0 - kShares[i]) * std::pow(d, kExponents[i]) + kShares[i] * std::pow(s, 1.1);
  }
  return linear;
}

// Sums over the draws become means.
void divide(ColourError& error, int draws) {
  error.mean /= draws;
  error.p95 /= draws;
  error.max /= draws;
}

void add(ColourError& sum, const ColourError& error) {
  sum.patches = error.patches;
  sum.mean += error.mean;
  sum.p95 += error.p95;
  sum.max += error.max;
}

// Every draw has seeds of its own, and so has everything that is read in it.
std::uint64_t seed_of(int draw, int what) {
  return 1000U * static_cast<unsigned>(draw + 1) + static_cast<unsigned>(what);
}

}  // namespace

Xyz LadderProjector::light(const Vector3d& drive) const {
  static const Xyz kFull = primaries()[0] + primaries()[1] + primaries()[2];
  static const Xyz kBlack = 0.0026 * kFull.cwiseProduct(Xyz(0.95, 1.0, 1.2));
  const Vector3d t = tones(drive);
  Xyz xyz = kBlack;
  for (Eigen::Index c = 0; c < 3; ++c) {
    const double others =
        std::sqrt(0.5 * (std::pow(t[(c + 1) % 3], 2) + std::pow(t[(c + 2) % 3], 2)));
    const double loaded = t[c] * (1.0 - defects_.crosstalk * others);
    const Xyz& primary = primaries()[static_cast<std::size_t>(c)];
    const double white = defects_.drift * (1.0 - t[c]);
    xyz += loaded * ((1.0 - white) * primary + white * primary.y() / kFull.y() * kFull);
  }
  return xyz + defects_.white_segment * t.minCoeff() * kFull;
}

std::vector<PatchReading> LadderProjector::read(std::span<const Rgb16> patches,
                                                int bits,
                                                double noise,
                                                std::uint64_t seed) const {
  Pcg32 random(seed);
  std::vector<PatchReading> readings;
  for (const Rgb16& patch : patches) {
    const Vector3d drive = drive_of_code(patch, bits);
    const Xyz error(random.normal(), random.normal(), random.normal());
    readings.push_back({drive, light(drive).cwiseProduct(Xyz::Ones() + noise * error)});
  }
  return readings;
}

std::span<const LadderRung> ladder_rungs() {
  static constexpr std::array kRungs{
      LadderRung{"none", {}, 8},
      LadderRung{"none", {}, 16},
      LadderRung{"6 % chromaticity drift", {0.06, 0, 0}, 4},
      LadderRung{"6 % chromaticity drift", {0.06, 0, 0}, 16},
      LadderRung{"25 % white segment", {0, 0.25, 0}, 16},
      LadderRung{"5 % channel crosstalk", {0, 0, 0.05}, 16},
      LadderRung{"drift + crosstalk", {0.06, 0, 0.05}, 16},
      LadderRung{"all three", {0.06, 0.25, 0.05}, 16},
  };
  return kRungs;
}

Result<LadderResult> climb(const LadderRung& rung) {
  const LadderProjector projector(rung.defects);
  ColourPatchOptions options;
  options.bits = kBits;
  options.ramp_levels = rung.ramp_levels;
  options.grey_levels = std::min(options.grey_levels, rung.ramp_levels);
  VENEER_TRY(options.check());
  const std::vector<Rgb16> ramps = ramp_patches(options);
  const std::vector<Rgb16> mixtures = interaction_patches(options);
  std::vector<Rgb16> all = ramps;
  all.insert(all.end(), mixtures.begin(), mixtures.end());
  const std::vector<Rgb16> unseen = verification_patches(kBits, kVerificationPatches, all);

  Pcg32 random(1);
  std::vector<PatchReading> truth;
  for (int i = 0; i < kLadderColours; ++i) {
    const double r = random.uniform();
    const double g = random.uniform();
    const Vector3d drive(r, g, random.uniform());
    truth.push_back({drive, projector.light(drive)});
  }

  LadderResult result;
  result.defect = rung.defect;
  result.ramp_patches = static_cast<int>(ramps.size());
  result.interaction_patches = static_cast<int>(mixtures.size());
  for (const ColourModelFamily& family : colour_model_families())
    result.models.push_back({family.name, true, {}, 0, 0, {}});
  std::map<std::string_view, int> chosen;
  for (int draw = 0; draw < kLadderDraws; ++draw) {
    std::vector<PatchReading> readings =
        projector.read(ramps, kBits, kLadderNoise, seed_of(draw, 0));
    const Xyz black = mean_black(readings);
    const std::size_t ramp_count = readings.size();
    const auto more = projector.read(mixtures, kBits, kLadderNoise, seed_of(draw, 1));
    readings.insert(readings.end(), more.begin(), more.end());
    for (std::size_t i = 0; i < result.models.size(); ++i) {
      const ColourModelFamily& family = colour_model_families()[i];
      const std::span<const PatchReading> fitted =
          std::span(readings).first(family.models_interaction ? readings.size() : ramp_count);
      VENEER_ASSIGN(const auto model, family.fit(fitted, black));
      ColourCandidate& candidate = result.models[i];
      candidate.parameters = model->parameters();
      candidate.patches = static_cast<int>(fitted.size());
      add(candidate.held_out, colour_error(*model, truth, black, projector.white()));
    }
    VENEER_ASSIGN(
        const Additivity additivity,
        test_additivity(
            projector.read(additivity_patches(options), kBits, kLadderNoise, seed_of(draw, 2)),
            black));
    result.additive_verdicts += additivity.additive ? 1 : 0;
    result.additivity_error += additivity.worst_error / kLadderDraws;
    VENEER_ASSIGN(
        const SelectedColour selected,
        select_colour_model(additivity.additive ? std::span(readings).first(ramp_count) : readings,
                            projector.read(unseen, kBits, kLadderNoise, seed_of(draw, 3)),
                            black,
                            additivity));
    ++chosen[selected.model->name()];
    add(result.chosen_error, colour_error(*selected.model, truth, black, projector.white()));
  }
  for (ColourCandidate& candidate : result.models) divide(candidate.held_out, kLadderDraws);
  divide(result.chosen_error, kLadderDraws);
  std::vector<std::pair<std::string_view, int>> by_count(chosen.begin(), chosen.end());
  std::ranges::stable_sort(by_count,
                           [](const auto& a, const auto& b) { return a.second > b.second; });
  for (const auto& [name, count] : by_count)
    result.chosen += fmt::format("{}{} ({})", result.chosen.empty() ? "" : ", ", name, count);
  return result;
}

}  // namespace veneer::calibration
