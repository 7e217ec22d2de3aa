// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Three tone curves and a cube of measured mixtures between them, see TetrahedralLut: supposes
/// nothing of what channels do to each other, and needs the most patches.
///
/// The tone curves are those of pca_spline() of one component; at the nodes of the cube they take
/// the drives of the patches to linear ones, in which additive light is interpolated exactly. The
/// nodes are the levels that `patches` has all mixtures of.
/// Errors: those of read_ramps(); kBadFormat (no complete cube of three nodes or more an axis).
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_lut3d(std::span<const PatchReading> patches,
                                                             const Xyz& black);

}  // namespace veneer::calibration
