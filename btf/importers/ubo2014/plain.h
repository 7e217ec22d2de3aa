// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "btf/importers/ubo2014/header.h"

namespace veneer::btf::ubo2014 {

/// Texels that lie one after another, [view][light][3] in float16, maybe compressed.
struct Chunk {
  std::span<const std::byte> bytes;
  std::uint64_t first = 0;  ///< the first texel's place among those that are stored
  std::uint64_t count = 0;
};

struct PlainTexels {
  std::vector<std::uint32_t> stored;  ///< the number of each texel that is stored, growing
  std::vector<Chunk> chunks;
  bool compressed = false;
};

/// Reads where an uncompressed file's texels lie, to its end. Errors: kBadFormat.
[[nodiscard]] Result<PlainTexels> read_plain(BinaryReader& reader, const Header& header);

/// Calls `use` with the place and the numbers of each texel of a chunk.
/// @param numbers  of a texel.
/// @return false where the chunk's compression is damaged or holds more or less.
[[nodiscard]] bool unpack(
    const Chunk& chunk,
    bool compressed,
    std::size_t numbers,
    const std::function<void(std::uint64_t place, std::span<const std::byte> values)>& use);

}  // namespace veneer::btf::ubo2014
