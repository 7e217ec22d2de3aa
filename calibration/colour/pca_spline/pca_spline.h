// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/additive_model.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// The name stands in the literature without a definition that we could find; this is ours. The
/// ramp of a channel, less black, is a matrix of levels by XYZ; its first `components` right
/// singular vectors (nothing is centred, so that drive 0 keeps its 0) are the channel's colours,
/// and a spline through the scores of the levels is each colour's curve.
///
/// One component is PLCC with the best direction for all levels in place of that at full drive, and
/// its curve, a tone curve then, is a monotone cubic. Two let the colour drift along one line.
/// Three are a change of basis and equal fit_plvc_spline().
/// @param components  1 to 3 (checked).   Errors: those of read_ramps().
[[nodiscard]] Result<AdditiveModel> pca_spline(std::span<const PatchReading> patches,
                                               const Xyz& black,
                                               int components);

/// pca_spline() of one and of two components.
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_pca1_spline(
    std::span<const PatchReading> patches, const Xyz& black);
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_pca2_spline(
    std::span<const PatchReading> patches, const Xyz& black);

}  // namespace veneer::calibration
