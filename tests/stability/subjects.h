// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "btf/internal_test_sets.h"
#include "btf/material.h"

// The models as the stability suite takes them: each in every way that it can keep its numbers.
namespace veneer::stability {

struct Subject {
  const char* name;  ///< of the test
  const char* model;
  btf::FitOptions options;
  /// Holds any low-rank data at the measured directions; else the model is a formula.
  bool has_components;
  /// What rounding of its storage leaves of a set that it holds, of the largest sample.
  double storage_error;
  /// What its value may jump by where the direction moves by 1e-7, of the largest sample: tables of
  /// directions (direction_lookup.h) are not continuous where a cell's triangle changes.
  double jump;
};
void PrintTo(const Subject& subject, std::ostream* out);

[[nodiscard]] std::span<const Subject> subjects();

struct Query {
  int texel;
  btf::Direction view;
  btf::Direction light;
};

/// At every pair of the directions, texels in turn.
[[nodiscard]] std::vector<Query> cross(const btf::DirectionSet& views,
                                       const btf::DirectionSet& lights,
                                       int texels);

/// The pole, grazing, on and below the horizon, seams and folds of the charts, and none of these.
[[nodiscard]] btf::DirectionSet awkward_directions();

/// radiance() of each, with the traps on.
[[nodiscard]] std::vector<Eigen::Vector3d> evaluate(const btf::Material& material,
                                                    std::span<const Query> queries);

/// The normal, 6 directions at 35 degrees and 10 at 75.
[[nodiscard]] btf::DirectionSet measured_directions();

/// 4 x 3 texels, polarised, under the measured directions.
[[nodiscard]] btf::SampleSetInfo usual_info();

/// A texel's colour of a channel, 0.2 to 0.9.
[[nodiscard]] double colour(int texel, int channel);

/// colour() cos(theta_l): what every model can hold.
[[nodiscard]] double lambert(const btf::SampleSetInfo& info, int texel, int light, int channel);

/// Lambert and a white lobe about the mirror direction.
[[nodiscard]] btf::SampleSet glossy_set(
    const std::filesystem::path& folder,
    const btf::DirectionSet& directions = measured_directions());

[[nodiscard]] Result<std::unique_ptr<btf::Material>> fit(const Subject& subject,
                                                         const btf::SampleSet& set);

}  // namespace veneer::stability
