// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"
#include "calibration/internal_reading_session.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// cos of the angle between the projector's axis and the ray of `pixel`.
[[nodiscard]] double axis_cosine(const ProjectorGeometry& geometry, const Eigen::Vector2d& pixel);

/// Radiant intensity over the raster, 1 at its centre, read at spots of the white board while white
/// is shown: on a coarse grid, filled in with cubics along rows, then columns.
/// @param columns, rows  of spots, 2 to 100 each.   @param ambient  what the board sends with the
/// lamp off.   Errors: kBadFormat (a spot without light), those of the instrument.
[[nodiscard]] Result<Image<float>> read_spot_fall_off(ReadingSession& session,
                                                      const ProjectorGeometry& geometry,
                                                      int columns,
                                                      int rows,
                                                      const Xyz& ambient);

}  // namespace veneer::calibration
