// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2014/plain.h"

// bzlib.h uses FILE without including what declares it.
// clang-format off
#include <cstdio>

#include <bzlib.h>
// clang-format on

#include <algorithm>
#include <limits>

namespace veneer::btf::ubo2014 {
namespace {

class Bunzip {
 public:
  explicit Bunzip(std::span<const std::byte> bytes) {
    good_ = BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK;
    // bzlib's pointer is not const, yet it does not write there.
    stream_.next_in = const_cast<char*>(reinterpret_cast<const char*>(bytes.data()));
    stream_.avail_in = static_cast<unsigned>(bytes.size());
  }
  Bunzip(const Bunzip&) = delete;
  Bunzip& operator=(const Bunzip&) = delete;
  ~Bunzip() { BZ2_bzDecompressEnd(&stream_); }
  // How many bytes come, at most as many as there is room for.
  std::size_t read(std::span<std::byte> room) {
    std::size_t done = 0;
    while (good_ && !ended_ && done < room.size()) {
      const std::size_t step =
          std::min<std::size_t>(room.size() - done, std::numeric_limits<unsigned>::max());
      stream_.next_out = reinterpret_cast<char*>(room.data() + done);
      stream_.avail_out = static_cast<unsigned>(step);
      const unsigned before = stream_.avail_in;
      const int status = BZ2_bzDecompress(&stream_);
      const std::size_t came = step - stream_.avail_out;
      done += came;
      ended_ = status == BZ_STREAM_END;
      good_ = ended_ || (status == BZ_OK && (came > 0 || stream_.avail_in < before));
    }
    return done;
  }
  // Whether everything was read and nothing is left.
  bool finished() {
    std::byte more{};
    return read({&more, 1}) == 0 && ended_ && stream_.avail_in == 0;
  }

 private:
  bz_stream stream_{};
  bool good_ = false;
  bool ended_ = false;
};

}  // namespace

Result<PlainTexels> read_plain(BinaryReader& reader, const Header& header) {
  constexpr int kFull = 0;
  constexpr int kBzip = 1;
  constexpr int kSparse = 2;
  const int compression = header.compression;
  if (compression != kFull && compression != kBzip && compression != kSparse)
    return reader.damaged("its compression {} is not known", compression);
  PlainTexels texels;
  texels.compressed = compression == kBzip;
  for (std::size_t t = 0; t < header.mask.size(); ++t) {
    if (compression != kSparse || header.mask[t] != std::byte{0})
      texels.stored.push_back(static_cast<std::uint32_t>(t));
  }
  const std::uint64_t in_chunk = std::uint64_t{header.width} * header.rows_per_chunk;
  for (std::uint64_t first = 0; first < texels.stored.size(); first += in_chunk) {
    Chunk chunk;
    chunk.first = first;
    chunk.count = std::min<std::uint64_t>(in_chunk, texels.stored.size() - first);
    VENEER_ASSIGN(const auto size, reader.read<std::uint32_t>("a chunk's size"));
    VENEER_ASSIGN(chunk.bytes, reader.take({size}, "a chunk"));
    if (!texels.compressed &&
        size != saturating_product({chunk.count, header.pair_count(), 3, sizeof(std::uint16_t)}))
      return reader.damaged("a chunk of {} texels has {} bytes", chunk.count, size);
    texels.chunks.push_back(chunk);
  }
  VENEER_TRY(reader.expect_end());
  return texels;
}

bool unpack(const Chunk& chunk,
            bool compressed,
            std::size_t numbers,
            const std::function<void(std::uint64_t, std::span<const std::byte>)>& use) {
  const std::size_t size = numbers * sizeof(std::uint16_t);
  if (!compressed) {
    for (std::uint64_t i = 0; i < chunk.count; ++i)
      use(chunk.first + i, chunk.bytes.subspan(static_cast<std::size_t>(i) * size, size));
    return true;
  }
  Bunzip unzip(chunk.bytes);
  std::vector<std::byte> texel(size);
  for (std::uint64_t i = 0; i < chunk.count; ++i) {
    if (unzip.read(texel) != size) return false;
    use(chunk.first + i, texel);
  }
  return unzip.finished();
}

}  // namespace veneer::btf::ubo2014
