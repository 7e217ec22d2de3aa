// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "btf/held_out.h"
#include "btf/sample_set.h"
#include "cli/comparison/published.h"
#include "cli/comparison/shader_cost.h"
#include "render/benchmark.h"

namespace veneer::cli {

/// epsilon of a texel: the mean absolute difference over its pairs and channels, of samples cut to
/// [0, 1] and raised to 1/2.2. Here over the texels of a set.
struct TexelErrors {
  double avg = 0;
  double min = 0;
  double max = 0;
};

/// What is left where every texel is replaced by the mean of all: how much texture a set has.
[[nodiscard]] TexelErrors mean_brdf_errors(const btf::SampleSet& set);

/// A second fit, of the views up to an angle only.
struct HeldOutFit {
  double fit_seconds = 0;
  btf::HeldOutErrors errors;
};

/// One line of the tables.
struct ComparedModel {
  std::string name;                           ///< such as "texel-colours 3+1"
  const PublishedModel* published = nullptr;  ///< null where the paper has no such model
  double fit_seconds = 0;
  std::optional<TexelErrors> errors{};
  double values_per_texel = 0;
  double bytes_per_texel = 0;  ///< of all textures on the GPU
  int fetches = 0;
  std::optional<ShaderCost> cost{};
  std::optional<render::RenderTiming> timing{};
  std::optional<HeldOutFit> held_out{};
};

struct Comparison {
  std::string set;
  int width = 0;   ///< texels
  int height = 0;  ///< texels
  int views = 0;
  int lights = 0;
  const PublishedMaterial* material = nullptr;  ///< null where the paper has no such material
  bool table1 = true;
  bool table2 = true;
  bool table3 = true;
  /// Views further from the normal are held out for Table 4; empty: there is no such table.
  std::optional<double> most_theta_deg{};
  std::optional<TexelErrors> mean_brdf{};
  std::vector<ComparedModel> models;
  std::string no_cost;       ///< why there is no count of instructions; empty where there is
  std::string no_timing;     ///< why nothing was timed; empty where it was
  std::string renderer;      ///< what was timed
  std::string timing_size;   ///< pixels, WIDTHxHEIGHT
  std::string timing_clock;  ///< what measured
  double plain_ms = 0;       ///< the draw that ratios are of
};

/// That one published model is worse than another, which holds on all materials of the paper: LAF,
/// SLAF, RF in this order, and each of them worse than PCA and than LPCA.
struct OrderClaim {
  const ComparedModel* worse;  ///< as published; borrowed from the comparison
  const ComparedModel* better;
  bool holds;  ///< here
};
/// The claims about those of the paper's models that are in the comparison, with their errors.
[[nodiscard]] std::vector<OrderClaim> published_order(const Comparison& comparison);

/// The names of the paper's models whose values a texel are not those of the paper's formula.
[[nodiscard]] std::vector<std::string> wrong_values(const Comparison& comparison);

/// The tables that are asked for, with the paper's figures where the material is the same and a
/// sentence on what each figure is.
[[nodiscard]] std::string to_markdown(const Comparison& comparison);
[[nodiscard]] nlohmann::ordered_json to_json(const Comparison& comparison);

}  // namespace veneer::cli
