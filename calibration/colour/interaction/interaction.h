// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// What channels do to each other, by a few terms: pca_spline() of two components is the core, and
/// to it comes, in X, Y and Z each, a sum of ten terms that are zero unless two channels are
/// driven. With the linear drives t they are t_i t_j of every two channels, t_i l(t_j) of every two
/// in either order, and t_r t_g t_b. l(t) = 1.1 t / (t + 0.1) is a load that is nearly all there at
/// a third of the light: a supply that gives way early, where t_i t_j is one that gives way evenly.
///
/// Least squares on all readings with several channels driven, weighted as lightness sees them.
/// Errors: those of read_ramps(); kBadFormat (fewer than kFewestMixtures mixtures, or mixtures so
/// alike that terms cannot be told apart).
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_interaction(
    std::span<const PatchReading> patches, const Xyz& black);

/// Twice the terms, so that noise is averaged.
inline constexpr int kFewestMixtures = 20;

}  // namespace veneer::calibration
