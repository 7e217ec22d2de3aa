// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// Reflectance transformation imaging: pictures of one camera, straight above, each under one
/// light.
///
/// @param source  a folder with one .lp file, or that file: the number of pictures, then a line
///     `name x y z` for each with the vector to its light (x right, y up, z to the camera; any
///     length). A name may carry folders or an extension that the pictures lost or changed since:
///     it is looked for as written, then by its stem anywhere under the folder.
///
/// Pictures are 8-bit JPEG or PNG in sRGB, decoded to linear light. They show radiance under each
/// light, so the light's cosine is in them; how bright white would have been is not known, and full
/// white is taken as 1. The set has the normal as its only view.
///
/// Errors: kNotFound (no .lp file, a missing picture); kBadFormat (more or fewer lines than stated,
/// a zero, non-finite or downward light, two equal lights, pictures of different sizes);
/// kInvalidOption (the crop).
[[nodiscard]] Status import_rti(const std::filesystem::path& source,
                                const std::filesystem::path& set,
                                const ImportOptions& options,
                                Progress& progress);

}  // namespace veneer::btf
