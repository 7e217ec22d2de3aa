// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// A BTF of the University of Bonn as pictures (UBO2003, ATRIUM): a zip archive, or a folder, of
/// JPEGs whose names end like `tl015 pl060 tv030 pv000.jpg`: theta and phi, in degrees, of light
/// and view. Folders and what stands before do not matter; other files are passed over.
///
/// The directions are those of the names, sorted by theta and phi; every view must be there with
/// every light. Pictures show radiance, so the light's cosine is in them; they are encoded with a
/// gamma of 2.2, and full white is taken as 1. They are decoded as often as it takes to keep at
/// most a gibibyte of their rows in memory at a time: twice for 6561 pictures of 256 x 256. Source:
/// Sattler, Sarlette, Klein 2003, "Efficient and Realistic Visualization of Cloth".
///
/// Errors: kNotFound; kBadFormat (no picture with such a name, two of one pair, a missing pair, a
/// damaged picture, pictures of different sizes); kInvalidOption (the crop).
[[nodiscard]] Status import_ubo2003(const std::filesystem::path& source,
                                    const std::filesystem::path& set,
                                    const ImportOptions& options,
                                    Progress& progress);

}  // namespace veneer::btf
