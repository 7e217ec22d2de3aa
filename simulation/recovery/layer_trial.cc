// SPDX-License-Identifier: Apache-2.0
#include "simulation/recovery/layer_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "btf/evaluation.h"
#include "btf/held_out.h"
#include "btf/material.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/layered/layer_fit.h"
#include "btf/models/layered/layered.h"
#include "btf/sample_set.h"
#include "btf/spread_texels.h"
#include "simulation/materials/layer_truth.h"
#include "simulation/materials/synthesize.h"
#include "simulation/materials/tracer.h"

namespace veneer::simulation {

namespace {

using MaterialPtr = std::unique_ptr<btf::Material>;

constexpr int kNoiseTexels = 128;    // that are traced twice
constexpr int kGrazingTexels = 256;  // that are compared beyond the fitted views
constexpr int kMostComponents = 8;
constexpr std::uint64_t kOtherPaths = 0x5EED;

double cut(double sample) { return std::clamp(sample, 0.0, 1.0); }

double rms(const std::vector<double>& squares, double count) {
  double sum = 0.0;
  for (const double square : squares) sum += square;
  return std::sqrt(sum / count);
}

double noise_of(const btf::SampleSet& set, const BodyField& field, SynthesisOptions options) {
  options.seed += kOtherPaths;
  const Tracer tracer(field, options);
  const std::vector<int> texels = btf::spread_texels(set.info(), kNoiseTexels);
  const auto pairs = static_cast<std::size_t>(set.info().pair_count());
  std::vector<double> squares(texels.size(), 0.0);
  parallel_for(std::ssize(texels), 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> again(pairs * 6);
    std::vector<float> rgb(pairs * 3);
    for (std::int64_t i = begin; i < end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      tracer.trace(texels[at], again);
      set.rgb(texels[at], btf::Part::kTotal, rgb);
      for (std::size_t pair = 0; pair < pairs; ++pair)
        for (std::size_t c = 0; c < 3; ++c) {
          const double step =
              cut(again[pair * 6 + c] + again[pair * 6 + 3 + c]) - cut(rgb[pair * 3 + c]);
          squares[at] += 0.5 * step * step;
        }
    }
  });
  return rms(squares, static_cast<double>(texels.size() * pairs * 3));
}

// The best clustered model that takes no more bytes, or the smallest.
Result<ModelError> best_clustered(const btf::SampleSet& set,
                                  double most_bytes,
                                  Progress& progress) {
  std::optional<ModelError> best;
  const auto is_better = [&](const ModelError& tried) {
    if (!best) return true;
    const bool best_is_small = best->bytes_per_texel <= most_bytes;
    if (tried.bytes_per_texel <= most_bytes) return !best_is_small || tried.rmse < best->rmse;
    return !best_is_small && tried.bytes_per_texel < best->bytes_per_texel;
  };
  for (const std::string_view name : {"lpca", "revised-lpca"}) {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(name));
    for (const int clusters : {1, 2, 4}) {
      for (int components = 1; components <= kMostComponents; ++components) {
        btf::FitOptions options;
        options.clusters = clusters;
        options.components = std::to_string(components);
        VENEER_ASSIGN(const MaterialPtr material, model->fit(set, options, progress));
        VENEER_ASSIGN(const btf::Evaluation evaluation, btf::evaluate(set, *material, progress));
        const ModelError tried{fmt::format("{} {}, {} clusters", name, components, clusters),
                               evaluation.linear.rmse,
                               evaluation.bytes_per_texel};
        if (is_better(tried)) best = tried;
        if (tried.bytes_per_texel > most_bytes) break;
      }
    }
  }
  return *best;
}

// Fits layers and keeps the stack in view, which a Material does not show.
Result<btf::LayerFit> fit_stack(const btf::SampleSet& set,
                                const btf::FitOptions& options,
                                Progress& progress) {
  VENEER_ASSIGN(const btf::FittedPairs pairs, btf::FittedPairs::of(set.info(), nullptr));
  return btf::fit_layers(set, pairs, options, progress);
}

MaterialPtr material_of(const btf::SampleSet& set, const btf::LayerStack& stack) {
  return btf::layered_material(btf::frame_of(set.info()), stack);
}

}  // namespace

Result<LayerTrial> try_layers(const BodyMaterial& material,
                              const LayerTrialOptions& options,
                              const std::filesystem::path& folder,
                              Progress& progress) {
  SynthesisOptions traced;
  traced.size = options.size;
  traced.views = options.directions;
  traced.lights = options.directions;
  traced.samples = options.samples;
  traced.bounces = options.bounces;
  traced.seed = options.seed;
  const std::filesystem::path path =
      folder / fmt::format("{}-{}.btfset", material.name, options.seed);
  VENEER_TRY(synthesize(material, path, traced, progress));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(path));
  const BodyField field = material.make(options.size, options.seed);

  LayerTrial trial;
  trial.noise = noise_of(set, field, traced);

  btf::FitOptions fit;
  fit.layers = static_cast<int>(material.heights.size());
  fit.heights = btf::HeightRange{material.heights.back() * options.size,
                                 material.heights.front() * options.size};
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(const btf::LayerFit layers, fit_stack(set, fit, progress));
  trial.fit_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  trial.fallback_points = layers.fallback_points;
  const MaterialPtr layered = material_of(set, layers.stack);
  VENEER_ASSIGN(const btf::Evaluation evaluation, btf::evaluate(set, *layered, progress));
  trial.layered = {fmt::format("layered, {} layers", layers.stack.layer_count()),
                   evaluation.linear.rmse,
                   evaluation.bytes_per_texel};
  std::vector<double> heights;
  for (const float height : layers.stack.heights()) heights.push_back(height / options.size);
  trial.agreement =
      layer_agreement(layers.stack, layer_truth(field, options.size, heights), options.directions);
  VENEER_ASSIGN(trial.clustered, best_clustered(set, trial.layered.bytes_per_texel, progress));

  const auto near_path = folder / fmt::format("{}-{}-near.btfset", material.name, options.seed);
  VENEER_ASSIGN(const btf::SampleSet near,
                btf::without_views_beyond(set, kMostFittedTheta_rad, near_path));
  VENEER_ASSIGN(const btf::LayerFit near_layers, fit_stack(near, fit, progress));
  const MaterialPtr near_layered = material_of(near, near_layers.stack);
  VENEER_ASSIGN(
      const btf::HeldOutErrors layered_errors,
      btf::held_out_errors(set, *near_layered, kMostFittedTheta_rad, kGrazingTexels, progress));
  VENEER_ASSIGN(const btf::Model* lpca, btf::find_model("lpca"));
  btf::FitOptions plain;
  plain.clusters = std::min(plain.clusters, set.info().texel_count());
  VENEER_ASSIGN(const MaterialPtr near_lpca, lpca->fit(near, plain, progress));
  VENEER_ASSIGN(
      const btf::HeldOutErrors lpca_errors,
      btf::held_out_errors(set, *near_lpca, kMostFittedTheta_rad, kGrazingTexels, progress));
  trial.grazing = {
      layered_errors.beyond.views, layered_errors.beyond.rmse, lpca_errors.beyond.rmse};
  return trial;
}

}  // namespace veneer::simulation
