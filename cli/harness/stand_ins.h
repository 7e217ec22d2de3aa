// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/progress.h"
#include "base/result.h"

namespace veneer::cli {

/// A glossy texture, whose highlight tells where the eye is taken to be; what an earlier run of
/// this program left is kept.
[[nodiscard]] Status make_stand_in_material(const std::filesystem::path& path, Progress& progress);
/// A projector as a book has it, 1.2 m in front of the object, which takes up the same part of the
/// picture's width at any size.
[[nodiscard]] Status make_stand_in_profile(const std::filesystem::path& path,
                                           int width,
                                           int height);

}  // namespace veneer::cli
