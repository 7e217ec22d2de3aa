// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/progress.h"
#include "base/result.h"
#include "btf/direction.h"
#include "simulation/materials/body_materials.h"
#include "simulation/recovery/layer_agreement.h"

namespace veneer::simulation {

struct LayerTrialOptions {
  int size = 32;                                          ///< texels along each side
  btf::DirectionSet directions = btf::bonn_directions();  ///< of view and of light
  int samples = 16;                                       ///< paths per texel and view
  int bounces = 1;
  std::uint64_t seed = 1;  ///< of the material and of the paths
};

struct ModelError {
  std::string model;  ///< such as "lpca 4, 2 clusters"
  double rmse = 0.0;  ///< linear, cut to [0, 1], over all samples of the set
  double bytes_per_texel = 0.0;
};

/// Of views further from the normal than the fit had any; linear, cut to [0, 1].
struct GrazingError {
  int views = 0;
  double layered = 0.0;  ///< rmse
  double lpca = 0.0;     ///< rmse, of FitOptions as they are: 32 clusters, more than equal bytes
};

/// What became of one material: traced, fitted, measured.
struct LayerTrial {
  /// Of the traced samples: rms of what differs between two runs with other paths, over sqrt(2).
  double noise = 0.0;
  double fit_seconds = 0.0;
  int fallback_points = 0;
  ModelError layered;
  /// The best of lpca and revised-lpca with no more bytes, or the smallest where all are larger.
  ModelError clustered;
  LayerAgreement agreement;
  GrazingError grazing;
};

/// Views up to here are fitted when the grazing ones are held out.
inline constexpr double kMostFittedTheta_rad = 1.0471975511965976;  // 60 degrees

/// Traces `material`, fits `layered` with as many layers as the material has heights, in the range
/// of these, and the clustered models; then fits it and lpca on the views up to 60 degrees.
/// @param folder  where sample sets are written; some hundred MiB at the usual sizes
/// Errors: kInvalidOption (options, or directions of which none is, or all are, beyond 60 degrees),
/// kIo, and those of fitting.
[[nodiscard]] Result<LayerTrial> try_layers(const BodyMaterial& material,
                                            const LayerTrialOptions& options,
                                            const std::filesystem::path& folder,
                                            Progress& progress);

}  // namespace veneer::simulation
