// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Gain, offset and exponent per channel, and a matrix: 15 numbers. For projectors that follow a
/// power; an S-shaped curve is out of its reach.
///
/// Offset and exponent of a channel are searched on grids that get finer, the primary follows in
/// closed form; errors are weighted as lightness sees them (perceptual_weight()).
/// Errors: those of read_ramps().
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_gog(std::span<const PatchReading> patches,
                                                           const Xyz& black);

}  // namespace veneer::calibration
