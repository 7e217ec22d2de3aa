// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// A BRDF of the RGL material database (.bsdf, the RGB variant), isotropic or anisotropic, as a set
/// of one texel at the options' directions. Source: Dupuy and Jakob 2018, "An Adaptive
/// Parameterization for Efficient Material Acquisition and Rendering".
///
/// A tensor file: a directory of named arrays, then their numbers at absolute offsets. For one
/// direction w of a pair, given by phi_i and theta_i, and the other o, with m the half vector:
///
///     f_r cos(o) = rgb(s; w) ndf(m) / (4 sigma(w)),    s = C(m; w)
///
/// where C takes m, as u = (sqrt(2 theta_m / pi), (phi_m + pi) / (2 pi)), to the cumulative
/// distribution of `vndf`: along theta in its row, and of the rows. An isotropic file (two phi_i or
/// fewer) counts phi_m from w. Everything is bilinear in u or s and linear in theta_i and phi_i,
/// and held beyond the first and last of these. w is taken as the view, so that the cosine is the
/// light's: sigma(w) = cos(w) / G_1(w) makes rgb = F G_2 / G_1, at most 1, for microfacets in that
/// reading only. A file that was lit from w says the same by Helmholtz' reciprocity. Values below 0
/// count as 0. Where a row of vndf is all 0, s is 0 along it.
///
/// Errors: kNotFound; kBadFormat (no tensor file, spectra instead of RGB, fields that are missing,
/// of other types or shapes, or outside the file; numbers that are not finite, or below 0 in ndf,
/// sigma and vndf; angles that do not rise; azimuths of less than a turn); kInvalidOption (crop,
/// directions).
[[nodiscard]] Status import_rgl(const std::filesystem::path& source,
                                const std::filesystem::path& set,
                                const ImportOptions& options,
                                Progress& progress);

}  // namespace veneer::btf
