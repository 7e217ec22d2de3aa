// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/result.h"

namespace veneer::capture {

struct SeriesPicture {
  std::filesystem::path path;
  double exposure_s = 0;
};

/// The pictures of a folder, sorted by name, and how long each was exposed: as `exposures.csv` in
/// it says, else the file's EXIF, else `exposure_s`. The first has a line "file,exposure_s" and one
/// for each picture: its name, and seconds as a decimal or a fraction ("1/60"). A RAW beside its
/// conversion is left alone, and so is a JPEG unless `allow_encoded`. Errors: kNotFound (no folder,
/// no pictures), kInvalidOption (exposures missing, JPEG not allowed), kBadFormat (a line of the
/// file).
[[nodiscard]] Result<std::vector<SeriesPicture>> find_series(const std::filesystem::path& folder,
                                                             std::optional<double> exposure_s,
                                                             bool allow_encoded);

}  // namespace veneer::capture
