// SPDX-License-Identifier: Apache-2.0
#include "quality/trade/grid.h"

#include <algorithm>
#include <set>
#include <string>

namespace veneer::quality {
namespace {

using btf::FitOptions;
using render::DrawingOptions;

/// What each size may be; the first is the one at which the others are varied.
struct Sizes {
  std::vector<std::string> one_term;
  std::vector<std::string> two_terms;
  std::vector<std::string> images;  ///< components of models without clusters
  std::vector<int> lobes;
  std::vector<int> layers;
  std::vector<int> clusters;
  std::vector<int> angular;
  std::vector<DrawingOptions> drawings;        ///< of a model's first fit
  std::vector<DrawingOptions> other_drawings;  ///< of its others
};

DrawingOptions drawing(int spacing, bool average, double scale) {
  DrawingOptions options;
  options.cache.spacing = spacing;
  options.average_texels = average;
  options.scale = scale;
  return options;
}

Sizes sizes_of(Grid grid) {
  if (grid == Grid::kCoarse)
    return {.one_term = {"4", "2", "8"},
            .two_terms = {"3+1", "6+2"},
            .images = {"16", "8"},
            .lobes = {2, 1},
            .layers = {4, 2, 1},
            .clusters = {32, 8},
            .angular = {16, 8},
            .drawings = {drawing(0, false, 1),
                         drawing(0, true, 1),
                         drawing(0, true, 0.5),
                         drawing(16, false, 1),
                         drawing(16, true, 1),
                         drawing(16, true, 0.5)},
            .other_drawings = {drawing(0, true, 1), drawing(16, true, 1)}};
  const std::vector<DrawingOptions> drawings{drawing(0, false, 1),
                                             drawing(0, true, 1),
                                             drawing(0, false, 0.5),
                                             drawing(0, true, 0.7),
                                             drawing(0, true, 0.5),
                                             drawing(8, false, 1),
                                             drawing(8, true, 1),
                                             drawing(16, false, 1),
                                             drawing(16, true, 1),
                                             drawing(16, true, 0.7),
                                             drawing(16, true, 0.5),
                                             drawing(32, false, 1),
                                             drawing(32, true, 1)};
  return {.one_term = {"4", "1", "2", "3", "6", "8", "12"},
          .two_terms = {"3+1", "2+2", "4+2", "6+2", "4+4", "8+4"},
          .images = {"16", "4", "8", "12"},
          .lobes = {2, 1, 3, 4},
          .layers = {4, 1, 2, 3, 6},
          .clusters = {32, 4, 8, 16, 64},
          .angular = {16, 6, 8, 12, 24},
          .drawings = drawings,
          .other_drawings = drawings};
}

/// The fits of one model: all numbers of components, of lobes or of layers, at the usual sizes; the
/// other sizes one by one at the first number of components.
std::vector<FitOptions> fits_of(const btf::Model& model,
                                const btf::SampleSetInfo& set,
                                Grid grid,
                                const FitOptions& base) {
  const Sizes sizes = sizes_of(grid);
  const FitReads reads = reads_of(model.name);
  std::vector<FitOptions> fits;
  const auto each = [&](int FitOptions::*field, const std::vector<int>& values) {
    for (const int value : values) {
      fits.push_back(base);
      fits.back().*field = value;
    }
  };
  if (model.terms == 0) {
    if (reads.lobes) each(&FitOptions::lobes, sizes.lobes);
    if (reads.layers) each(&FitOptions::layers, sizes.layers);
    if (fits.empty()) fits.push_back(base);
    return fits;
  }
  const std::vector<std::string>& components = model.terms == 2 ? sizes.two_terms
                                               : reads.clusters ? sizes.one_term
                                                                : sizes.images;
  for (const std::string& count : components) {
    fits.push_back(base);
    fits.back().components = count;
  }
  const FitOptions first = fits.front();
  const auto vary = [&](auto FitOptions::*field, const auto& values) {
    for (const auto& value : values) {
      FitOptions varied = first;
      varied.*field = value;
      fits.push_back(varied);
    }
  };
  if (reads.clusters) vary(&FitOptions::clusters, sizes.clusters);
  if (reads.angular) vary(&FitOptions::angular, sizes.angular);
  // Where a model stores 8 bits by itself, or half floats, the other is what is of interest; its
  // own choice under its own name would be the same fit again.
  if (reads.precision) vary(&FitOptions::precision, std::vector<std::string>{"float16"});
  for (FitOptions& fit : fits) fit.clusters = std::min(fit.clusters, set.texel_count());
  return fits;
}

}  // namespace

Result<Grid> parse_grid(std::string_view text) {
  if (text == "coarse") return Grid::kCoarse;
  if (text == "fine") return Grid::kFine;
  return fail(Errc::kInvalidOption, "the grid \"{}\" is unknown; it is coarse or fine", text);
}

std::string_view name_of(Grid grid) { return grid == Grid::kCoarse ? "coarse" : "fine"; }

Result<std::vector<Candidate>> candidates_of(const btf::SampleSetInfo& set,
                                             const GridOptions& options) {
  for (const std::string& name : options.models) {
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(name));
    if (model->polarised && !set.polarised)
      return fail(Errc::kInvalidOption,
                  "measuring the trade: {} needs a set whose specular part was measured by itself, "
                  "and this one has none; leave that model out",
                  name);
  }
  btf::FitOptions base;
  base.iterations = options.iterations;
  base.seed = options.seed;
  const Sizes sizes = sizes_of(options.grid);
  std::vector<Candidate> candidates;
  std::set<std::string> seen;
  for (const btf::Model& model : btf::models()) {
    if (model.polarised && !set.polarised) continue;
    if (!options.models.empty() &&
        std::ranges::find(options.models, model.name) == options.models.end())
      continue;
    bool first = true;
    for (const FitOptions& fit : fits_of(model, set, options.grid, base)) {
      for (const DrawingOptions& drawing : first ? sizes.drawings : sizes.other_drawings) {
        Candidate candidate{std::string(model.name), fit, drawing};
        // The cache of a model that offers none is no way of its own.
        if (seen.insert(candidate.key()).second) candidates.push_back(std::move(candidate));
      }
      first = false;
    }
  }
  return candidates;
}

}  // namespace veneer::quality
