// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/rgl/tensor_file.h"

#include <array>
#include <cmath>

namespace veneer::btf {
namespace {

constexpr std::string_view kMagic("tensor_file\0", 12);
constexpr std::uint8_t kVersion = 1;
// Bytes of an element, by the file's number for its type: none, int8 to uint64 by size and unsigned
// first, float16, float32, float64.
constexpr std::array<std::uint64_t, 12> kTypeBytes{0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
constexpr int kFloat32 = 10;

std::string text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

Result<TensorFile> TensorFile::open(const std::filesystem::path& path) {
  TensorFile result;
  result.doing_ = fmt::format("reading {}", path.string());
  VENEER_ASSIGN(result.file_, BinaryFile::open(path));
  const std::span<const std::byte> bytes = result.file_.bytes();
  BinaryReader reader(bytes, result.doing_);
  VENEER_ASSIGN(const auto magic, reader.take({kMagic.size()}, "the format's name"));
  if (text(magic) != kMagic) return reader.damaged("it is no tensor file (.bsdf)");
  VENEER_ASSIGN(const auto major, reader.read<std::uint8_t>("the version"));
  VENEER_ASSIGN(const auto minor, reader.read<std::uint8_t>("the version"));
  if (major != kVersion)
    return reader.damaged("it is of version {}.{}; {}.0 is known", major, minor, kVersion);
  VENEER_ASSIGN(const auto count, reader.read<std::uint32_t>("the number of fields"));
  if (count > kMostFields)
    return reader.damaged("it claims {} fields, over {}", count, kMostFields);
  for (std::uint32_t i = 0; i < count; ++i) {
    VENEER_ASSIGN(const auto length, reader.read<std::uint16_t>("the length of a name"));
    VENEER_ASSIGN(const auto name_bytes, reader.take({length}, "a name"));
    const std::string name = text(name_bytes);
    VENEER_ASSIGN(const auto dimensions, reader.read<std::uint16_t>("a number of dimensions"));
    VENEER_ASSIGN(const auto type, reader.read<std::uint8_t>("a type"));
    VENEER_ASSIGN(const auto offset, reader.read<std::uint64_t>("an offset"));
    if (type == 0 || type >= kTypeBytes.size())
      return reader.damaged("field {} has the unknown type {}", i, type);
    if (dimensions == 0 || dimensions > kMostDimensions)
      return reader.damaged(
          "field {} has {} dimensions; 1 to {} are known", i, dimensions, kMostDimensions);
    Field field;
    field.type = type;
    std::uint64_t size = kTypeBytes[type];
    for (int d = 0; d < dimensions; ++d) {
      VENEER_ASSIGN(const auto extent, reader.read<std::uint64_t>("a shape"));
      field.shape.push_back(extent);
      size = saturating_product({size, extent});
    }
    if (offset > bytes.size() || size > bytes.size() - offset)
      return reader.damaged(
          "field {} has {} bytes at {}, beyond the file's {}", i, size, offset, bytes.size());
    field.bytes = bytes.subspan(offset, size);
    if (!result.fields_.emplace(name, std::move(field)).second)
      return reader.damaged("field {} has the name of another", i);
  }
  return result;
}

Result<TensorFile::Floats> TensorFile::floats(const std::string& name,
                                              std::size_t dimensions) const {
  const auto found = fields_.find(name);
  if (found == fields_.end()) return fail(Errc::kBadFormat, "{}: it has no {}", doing_, name);
  const Field& field = found->second;
  if (field.type != kFloat32 || field.shape.size() != dimensions)
    return fail(
        Errc::kBadFormat, "{}: {} should be float32 of {} dimensions", doing_, name, dimensions);
  if (field.bytes.empty()) return fail(Errc::kBadFormat, "{}: {} has no elements", doing_, name);
  Floats result{{field.shape.begin(), field.shape.end()},
                std::vector<float>(field.bytes.size() / sizeof(float))};
  for (std::size_t i = 0; i < result.values.size(); ++i) {
    result.values[i] = number_at<float>(field.bytes, i);
    if (!std::isfinite(result.values[i]))
      return fail(Errc::kBadFormat, "{}: {}: element {} is not finite", doing_, name, i);
  }
  return result;
}

}  // namespace veneer::btf
