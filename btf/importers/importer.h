// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"

namespace veneer::btf {

/// A rectangle of texels to keep.
struct Crop {
  int x{};
  int y{};
  int width{};
  int height{};
};

struct ImportOptions {
  std::optional<Crop> crop;  ///< the whole where absent
  /// Where a BRDF is sampled, which has no directions of its own: "bonn81" or "ubo151" for the
  /// lists of direction.h, as views and as lights.
  std::string directions = "bonn81";
};

/// One line of the importers' registry: brings a source to a sample set, in the sample's unit.
struct Importer {
  std::string_view name;
  std::string_view summary;
  /// Errors: kNotFound, kBadFormat (names the file and what is wrong with it), kInvalidOption (a
  /// crop outside the source).
  Status (*run)(const std::filesystem::path& source,
                const std::filesystem::path& set,
                const ImportOptions& options,
                Progress& progress);
};

/// Every importer, sorted by name.
[[nodiscard]] std::span<const Importer> importers();
/// Errors: kInvalidOption, naming the importers there are.
[[nodiscard]] Result<const Importer*> find_importer(std::string_view name);

}  // namespace veneer::btf
