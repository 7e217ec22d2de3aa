// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// An anisotropic BRDF of the UTIA database (.bin), as a set of one texel at the options'
/// directions.
///
/// The file holds nothing but three planes (R, G, B) of 288 x 288 float64: a row for each light, a
/// column for each view, both 48 azimuths (steps of 7.5 degrees from 0) at each theta 0, 15,
/// ... 75. Values are taken as f_r in linear light, without the light's cosine. Between the knots
/// they are interpolated linearly in all four angles; beyond 75 degrees they are extrapolated.
/// Negative results count as 0, and the progress says for how many samples. Source: Filip, Vavra
/// 2014, "Template-Based Sampling of Anisotropic BRDFs".
///
/// Errors: kNotFound; kBadFormat (another size, a value that is not finite); kInvalidOption (crop,
/// directions).
[[nodiscard]] Status import_utia(const std::filesystem::path& source,
                                 const std::filesystem::path& set,
                                 const ImportOptions& options,
                                 Progress& progress);

}  // namespace veneer::btf
