// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// For machines with a white segment in their colour wheel, which is lit by what all three channels
/// have in common: pca_spline() of two components is the core, and to it comes a light that depends
/// on the least of the three linear drives. Its X, Y and Z over that least one are monotone cubics
/// through what the grey patches have beyond the core.
/// Source: after Wyble and Rosen 2004, "Color Management of DLP Projectors" (via its summary).
/// Errors: those of read_ramps(); kBadFormat (fewer than kFewestGreys levels of grey, or no white).
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_white_segment(
    std::span<const PatchReading> patches, const Xyz& black);

inline constexpr int kFewestGreys = 4;

}  // namespace veneer::calibration
