// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// An isotropic BRDF of the MERL database (.binary), as a set of one texel at the options'
/// directions.
///
/// The file holds three int32 (90, 90, 180) and three planes of float64 (R, G, B) over the half
/// angle, the difference angle and the difference azimuth (Rusinkiewicz 1998). The value of a pair
/// is that of the cell it falls in, as the database's own reader takes it; cells are even in
/// sqrt(theta_h), in theta_d and in phi_d, which is taken modulo pi. Values are f_r times 1500 (R),
/// 1500/1.15 (G) and 1500/1.66 (B), without the light's cosine. A negative one marks a pair that
/// was not measured: it counts as 0, and the progress says for how many samples. Source: Matusik,
/// Pfister, Brand, McMillan 2003, "A Data-Driven Reflectance Model".
///
/// Errors: kNotFound; kBadFormat (other dimensions, another size, a value that is not finite);
/// kInvalidOption (crop, directions).
[[nodiscard]] Status import_merl(const std::filesystem::path& source,
                                 const std::filesystem::path& set,
                                 const ImportOptions& options,
                                 Progress& progress);

}  // namespace veneer::btf
