// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/camera.h"

namespace veneer::capture {

/// Angles of the analysers on the sensor, radians: 0, 45, 90, 135 degrees, the order of all that
/// follows here.
[[nodiscard]] const std::array<double, 4>& mosaic_angles();
/// "polarsens-mono", "polarsens-colour". Errors: kInvalidOption, naming both.
[[nodiscard]] Result<Mosaic> mosaic_named(std::string_view name);

/// The four readings of every cell of a mosaic, without interpolation: a picture of half the width
/// and height (a quarter, with colour: a cell is then 4 x 4 and has R, the mean of both G, and B).
/// A pixel has seen one colour: of a monochrome mosaic the first channel is read.
struct MosaicCells {
  /// For each angle; a monochrome one repeats its value.
  std::array<Image<Rgb32f>, 4> counts;
  /// 1 where a pixel of the cell was at full scale, or no number: one clipped angle fakes a degree
  /// of polarisation.
  Image<std::uint8_t> saturated;
};
/// Errors: kBadFormat (a size that is no whole number of cells; a frame without a mosaic).
[[nodiscard]] Result<MosaicCells> mosaic_cells(const Image<Rgb32f>& counts,
                                               double full_scale,
                                               Mosaic mosaic);

/// The same at full resolution: every angle (and colour) interpolated between its own pixels, so
/// that what is linear in space comes back exactly, borders included (along a side of one cell
/// only: what is constant). A pixel is saturated where any that it was interpolated from was.
/// Errors: as of mosaic_cells().
[[nodiscard]] Result<MosaicCells> demosaic(const Image<Rgb32f>& counts,
                                           double full_scale,
                                           Mosaic mosaic);

}  // namespace veneer::capture
