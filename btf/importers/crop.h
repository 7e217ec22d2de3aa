// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "btf/importers/importer.h"

namespace veneer::btf {

/// The rectangle that the options ask for of a source of this size: the whole where they ask for
/// none. Errors: kInvalidOption where it is empty or reaches outside, naming the source's size.
[[nodiscard]] Result<Crop> crop_of(const ImportOptions& options,
                                   int width,
                                   int height,
                                   std::string_view doing);

}  // namespace veneer::btf
