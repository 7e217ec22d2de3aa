// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/result.h"

namespace veneer::btf {

/// a * b * ..., or the largest number where that does not fit.
[[nodiscard]] std::uint64_t saturating_product(std::initializer_list<std::uint64_t> factors);

/// A file's bytes, memory-mapped read-only. Cheap to copy.
class BinaryFile {
 public:
  /// Errors: kNotFound; kBadFormat (a folder, an empty file).
  [[nodiscard]] static Result<BinaryFile> open(const std::filesystem::path& path);
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::shared_ptr<const void> mapping_;
  std::span<const std::byte> bytes_;
};

/// Reads little-endian values one after another, none of them beyond the end: whatever a file
/// claims to hold is compared with its size before anybody asks for memory.
class BinaryReader {
 public:
  /// @param doing  begins every message.
  BinaryReader(std::span<const std::byte> bytes, std::string doing)
      : rest_(bytes), size_(bytes.size()), doing_(std::move(doing)) {}

  /// Errors: kBadFormat, naming `what` and where it should stand.
  template <class Number>
  [[nodiscard]] Result<Number> read(std::string_view what) {
    static_assert(std::is_arithmetic_v<Number> && std::endian::native == std::endian::little);
    VENEER_ASSIGN(const std::span<const std::byte> bytes, take({sizeof(Number)}, what));
    Number value;
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  /// The next bytes, as many as the product of `counts`. Errors: as read().
  [[nodiscard]] Result<std::span<const std::byte>> take(std::initializer_list<std::uint64_t> counts,
                                                        std::string_view what);
  /// At most `count` of the next bytes, which stay to be read.
  [[nodiscard]] std::span<const std::byte> peek(std::size_t count) const {
    return rest_.first(std::min(count, rest_.size()));
  }
  [[nodiscard]] std::uint64_t position() const { return size_ - rest_.size(); }
  [[nodiscard]] std::uint64_t remaining() const { return rest_.size(); }
  /// Errors: kBadFormat where bytes are left.
  [[nodiscard]] Status expect_end() const;
  /// kBadFormat with a formatted text after what is being done.
  template <class... Args>
  [[nodiscard]] tl::unexpected<Error> damaged(fmt::format_string<Args...> text,
                                              Args&&... args) const {
    return fail(Errc::kBadFormat, "{}: {}", doing_, fmt::format(text, std::forward<Args>(args)...));
  }

 private:
  std::span<const std::byte> rest_;
  std::uint64_t size_;
  std::string doing_;
};

/// Numbers that lie anywhere in a file, aligned or not.
template <class Number>
[[nodiscard]] Number number_at(std::span<const std::byte> bytes, std::size_t index) {
  Number value;
  std::memcpy(&value, bytes.data() + index * sizeof(Number), sizeof value);
  return value;
}

}  // namespace veneer::btf
