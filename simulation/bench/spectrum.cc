// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/spectrum.h"

#include <algorithm>
#include <cmath>

#include "base/result.h"

namespace veneer::simulation {
namespace {

/// Rows: x, y, z bar; columns: bands.
const Eigen::Matrix<double, 3, kBands>& colour_matching_functions() {
  static const auto kFunctions = [] {
    Eigen::Matrix<double, 3, kBands> f;
    // clang-format off
    f << 0.0143, 0.0435, 0.1344, 0.2839, 0.3483, 0.3362, 0.2908, 0.1954, 0.0956, 0.0320, 0.0049,
         0.0093, 0.0633, 0.1655, 0.2904, 0.4334, 0.5945, 0.7621, 0.9163, 1.0263, 1.0622, 1.0026,
         0.8544, 0.6424, 0.4479, 0.2835, 0.1649, 0.0874, 0.0468, 0.0227, 0.0114,
         0.0004, 0.0012, 0.0040, 0.0116, 0.0230, 0.0380, 0.0600, 0.0910, 0.1390, 0.2080, 0.3230,
         0.5030, 0.7100, 0.8620, 0.9540, 0.9950, 0.9950, 0.9520, 0.8700, 0.7570, 0.6310, 0.5030,
         0.3810, 0.2650, 0.1750, 0.1070, 0.0610, 0.0320, 0.0170, 0.0082, 0.0041,
         0.0679, 0.2074, 0.6456, 1.3856, 1.7471, 1.7721, 1.6692, 1.2876, 0.8130, 0.4652, 0.2720,
         0.1582, 0.0782, 0.0422, 0.0203, 0.0087, 0.0039, 0.0021, 0.0017, 0.0011, 0.0008, 0.0003,
         0.0002, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000;
    // clang-format on
    return f;
  }();
  return kFunctions;
}

}  // namespace

Xyz xyz_of(const Spectrum& radiance) {
  constexpr double kLuminousEfficacy = 683.0;  // lm/W, CIE 1931 photopic
  constexpr double kBandWidth_nm = 10.0;
  return kLuminousEfficacy * kBandWidth_nm * (colour_matching_functions() * radiance.matrix());
}

Spectrum gaussian_spectrum(double centre_nm, double sigma_nm) {
  Spectrum s;
  for (int band = 0; band < kBands; ++band)
    s[band] = std::exp(-0.5 * std::pow((wavelength_nm(band) - centre_nm) / sigma_nm, 2));
  return s;
}

Spectrum planckian_spectrum(double kelvin) {
  constexpr double kSecondRadiation_nm_K = 1.438776877e7;  // h c / k
  constexpr double kNorm_nm = 560.0;
  const auto planck = [kelvin](double nm) {
    return std::pow(nm / kNorm_nm, -5) / std::expm1(kSecondRadiation_nm_K / (nm * kelvin));
  };
  Spectrum s;
  for (int band = 0; band < kBands; ++band) s[band] = planck(wavelength_nm(band));
  return s / planck(kNorm_nm);
}

Spectrum planckian_light(double kelvin, double nits) {
  const Spectrum shape = planckian_spectrum(kelvin);
  return shape * (nits / xyz_of(shape).y());
}

Spectrum interpolated_spectrum(const std::vector<double>& at_nm,
                               const std::vector<double>& values) {
  VENEER_CHECK(!at_nm.empty() && at_nm.size() == values.size());
  VENEER_CHECK(std::ranges::adjacent_find(at_nm, std::ranges::greater_equal{}) == at_nm.end());
  Spectrum s;
  for (int band = 0; band < kBands; ++band) {
    const double nm = wavelength_nm(band);
    const auto after = std::ranges::lower_bound(at_nm, nm);
    const auto i = static_cast<std::size_t>(after - at_nm.begin());
    if (i == 0) {
      s[band] = values.front();
    } else if (after == at_nm.end()) {
      s[band] = values.back();
    } else {
      s[band] =
          std::lerp(values[i - 1], values[i], (nm - at_nm[i - 1]) / (at_nm[i] - at_nm[i - 1]));
    }
  }
  return s;
}

}  // namespace veneer::simulation
