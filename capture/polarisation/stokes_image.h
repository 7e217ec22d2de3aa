// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/image.h"
#include "base/result.h"
#include "capture/polarisation/mosaic.h"

namespace veneer::capture {

/// Stokes parameters of every cell (or pixel) and colour channel; see LinearStokes.
struct StokesImage {
  Image<Rgb32f> s0, s1, s2;
  /// What four angles say twice, (I0 + I90) - (I45 + I135), in the unit of S0. Of analysers and
  /// pixels that are alike it is noise around zero; a bias of it is a bias between them.
  Image<Rgb32f> redundancy;
  Image<std::uint8_t> saturated;  ///< as of the cells: what stands there is worth nothing
};
/// Least squares of all four readings (StokesSolver).
/// @param extinction  Imax / Imin of the analysers.
/// Errors: kInvalidOption (an extinction that is not above 1).
[[nodiscard]] Result<StokesImage> stokes_image(const MosaicCells& cells, double extinction);

/// How polarised the light of a picture is, over its usable cells: not saturated, and S0 at least
/// `least_s0`, below which noise alone looks polarised. Of the green channel.
struct PolarisationSummary {
  std::size_t cells_used = 0;  ///< where it is 0, the others but saturated_fraction are too
  double saturated_fraction = 0;
  double dolp_p50 = 0;  ///< degrees of linear polarisation; linear between order statistics
  double dolp_p95 = 0;
  double dolp_p999 = 0;
  double residual_median = 0;  ///< of redundancy / S0
};
[[nodiscard]] PolarisationSummary summarise(const StokesImage& image, double least_s0);

}  // namespace veneer::capture
