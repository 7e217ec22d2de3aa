// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <functional>
#include <string>

#include "btf/importers/importer.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// What a BRDF sends from a light to a view: f_r * cos(theta_l), 1/sr, linear sRGB. Not negative,
/// finite or not: write_brdf() refuses what is not.
using ReflectedLight =
    std::function<Eigen::Vector3d(const Direction& view, const Direction& light)>;

/// The directions that the options ask for. Errors: kInvalidOption, naming the choices.
[[nodiscard]] Result<DirectionSet> direction_grid(const ImportOptions& options);

/// Writes a BRDF, which knows no texels, as a set of one texel at every pair of the chosen
/// directions.
/// @param source, licence  for SampleSetInfo.
/// The set's scale is that of its largest sample.
/// Errors: kInvalidOption (the crop, the directions), kBadFormat (a value that is not finite or
/// over kMostScale), kIo.
[[nodiscard]] Status write_brdf(const std::filesystem::path& file,
                                const std::filesystem::path& set,
                                const ImportOptions& options,
                                const std::string& source,
                                const std::string& licence,
                                const ReflectedLight& brdf);

}  // namespace veneer::btf
