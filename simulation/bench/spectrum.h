// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "base/colour.h"

namespace veneer::simulation {

/// The bench computes in 31 bands, 400 to 700 nm by 10 nm.
inline constexpr int kBands = 31;
[[nodiscard]] constexpr double wavelength_nm(int band) { return 400.0 + 10.0 * band; }

/// One value a band: radiance in W / (m^2 sr nm), or a dimensionless reflectance.
using Spectrum = Eigen::Array<double, kBands, 1>;

/// CIE 1931 2 degree colour of a spectral radiance, Y in cd/m^2: 683 lm/W times the sum over bands
/// with the tabulated colour matching functions. What lies outside 400 to 700 nm (under 0.4 % of
/// each function's integral) is left out.
/// Source: CIE 15:2004, "Colorimetry", table T.4, every second row.
[[nodiscard]] Xyz xyz_of(const Spectrum& radiance);

/// A line of Gaussian shape, 1 at its centre.   @param sigma_nm  > 0.
[[nodiscard]] Spectrum gaussian_spectrum(double centre_nm, double sigma_nm);

/// Planck's law relative to its value at 560 nm.   @param kelvin  > 0.
[[nodiscard]] Spectrum planckian_spectrum(double kelvin);

/// Planck's law with a luminance in cd/m^2.   @param kelvin  > 0.
[[nodiscard]] Spectrum planckian_light(double kelvin, double nits);

/// Straight lines between given points, constant beyond them.
/// @param at_nm  at least one wavelength, strictly rising (checked).   @param values  one each.
[[nodiscard]] Spectrum interpolated_spectrum(const std::vector<double>& at_nm,
                                             const std::vector<double>& values);

}  // namespace veneer::simulation
