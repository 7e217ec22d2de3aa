// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "btf/importers/binary_reader.h"

namespace veneer::btf {

/// A file of named arrays (.bsdf of RGL), memory-mapped. Every array lies inside the file.
class TensorFile {
 public:
  struct Field {
    int type = 0;
    std::vector<std::uint64_t> shape;
    std::span<const std::byte> bytes;
  };
  /// Errors: kNotFound; kBadFormat (another format or version, more than kMostFields, a field that
  /// is named twice, has an unknown type, or lies outside the file).
  [[nodiscard]] static Result<TensorFile> open(const std::filesystem::path& path);
  [[nodiscard]] bool has(const std::string& name) const { return fields_.count(name) != 0; }
  /// An array of float32, copied. Errors: kBadFormat (missing, another type or number of
  /// dimensions, no elements, a value that is not finite).
  struct Floats {
    std::vector<std::size_t> shape;
    std::vector<float> values;
  };
  [[nodiscard]] Result<Floats> floats(const std::string& name, std::size_t dimensions) const;

  static constexpr std::uint32_t kMostFields = 64;
  static constexpr std::uint16_t kMostDimensions = 8;

 private:
  BinaryFile file_;
  std::map<std::string, Field> fields_;
  std::string doing_;
};

}  // namespace veneer::btf
