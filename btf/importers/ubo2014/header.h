// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "btf/direction.h"
#include "btf/importers/binary_reader.h"

namespace veneer::btf::ubo2014 {

/// What a body's layout depends on.
enum class Body { kFactors, kDecorrelatedFactors, kViewFactors, kPlain };

/// What the files of the University of Bonn have in common, read as btflib (Merzbach 2014) does.
struct Header {
  Body body = Body::kFactors;
  bool extended = false;  ///< a version byte and its fields stand before the factors
  bool cosine_included = false;
  double texels_per_mm = 0.0;  ///< not positive where unknown
  DirectionSet views;
  DirectionSet lights;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  // Of kPlain only.
  std::uint32_t rows_per_chunk = 0;
  std::uint8_t compression = 0;
  std::span<const std::byte> mask;  ///< a byte for each texel: 0 where it is missing

  [[nodiscard]] std::uint64_t texel_count() const { return std::uint64_t{width} * height; }
  [[nodiscard]] std::uint64_t pair_count() const {
    return std::uint64_t{views.size()} * lights.size();
  }
};

/// Leaves `reader` at the body. Errors: kBadFormat.
[[nodiscard]] Result<Header> read_header(BinaryReader& reader);

}  // namespace veneer::btf::ubo2014
