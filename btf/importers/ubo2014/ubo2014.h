// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// A BTF of the University of Bonn (.btf): uncompressed (BDI: plain, in bzip chunks or without the
/// texels that are missing), factorised as a whole (FMF), channel by channel (DFMF) or view by view
/// (PVF), in RGB.
///
/// Angles are radians; every view is taken to have the first one's lights, as the format demands.
/// Values are reflectance relative to a white diffuser, up to the exposure of the measurement.
/// Where the file's flag says that the light's cosine is not in them (in version 1, which has no
/// flag, it is not), they are multiplied by it. The first row of texels is on top. Texels that are
/// missing are black; negative values, which a factorisation makes, count as 0; the progress says
/// how many. Source: Schwartz, Sarlette, Weinmann, Klein 2013, "DOME II: A Parallelized BTF
/// Acquisition System"; the layout is that of Bonn's btflib (Merzbach 2014).
///
/// Errors: kNotFound; kBadFormat (a signature that is not known, spectral or Lab colours, a file
/// that does not hold what its header states, directions that are equal or below the surface, a
/// value that is not finite); kInvalidOption (the crop).
[[nodiscard]] Status import_ubo2014(const std::filesystem::path& source,
                                    const std::filesystem::path& set,
                                    const ImportOptions& options,
                                    Progress& progress);

}  // namespace veneer::btf
