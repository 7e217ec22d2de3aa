// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace veneer {

/// Element types of the safetensors format that Veneer uses.
enum class DType { kU8, kU16, kI32, kF16, kF32, kF64 };
[[nodiscard]] std::size_t size_of(DType dtype);
[[nodiscard]] std::string_view name_of(DType dtype);

template <class T>
struct DTypeOf;
template <>
struct DTypeOf<std::uint8_t> {
  static constexpr DType kValue = DType::kU8;
};
template <>
struct DTypeOf<std::uint16_t> {
  static constexpr DType kValue = DType::kU16;
};
template <>
struct DTypeOf<std::int32_t> {
  static constexpr DType kValue = DType::kI32;
};
template <>
struct DTypeOf<Eigen::half> {
  static constexpr DType kValue = DType::kF16;
};
template <>
struct DTypeOf<float> {
  static constexpr DType kValue = DType::kF32;
};
template <>
struct DTypeOf<double> {
  static constexpr DType kValue = DType::kF64;
};

/// A tensor inside a file: row-major, last dimension fastest. Borrowed from the SafetensorsFile.
struct TensorView {
  DType dtype;
  std::vector<std::int64_t> shape;
  std::span<const std::byte> bytes;

  [[nodiscard]] std::int64_t count() const;
  /// The elements. The type must be that of `dtype` (checked).
  template <class T>
  [[nodiscard]] std::span<const T> as() const {
    VENEER_CHECK(DTypeOf<T>::kValue == dtype);
    return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
};

/// A safetensors file, memory-mapped and read-only; tensors are views into the map. Movable; views
/// stay valid while it (or what it was moved to) lives.
/// Format: u64 little-endian header length, JSON header, raw tensors.
class SafetensorsFile {
 public:
  /// Errors: kNotFound, kIo, kBadFormat (truncated, header no JSON, offsets outside the file,
  /// tensors that overlap or do not fill it, size that does not fit the shape, misaligned data).
  [[nodiscard]] static Result<SafetensorsFile> open(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const;
  [[nodiscard]] const std::map<std::string, std::string>& metadata() const;
  [[nodiscard]] bool contains(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> names() const;
  /// The tensor `name` with `dtype` and `shape`, where -1 stands for any extent. An empty shape
  /// asks for nothing. Errors: kBadFormat, naming file, tensor, what is there and what was
  /// expected.
  [[nodiscard]] Result<TensorView> tensor(const std::string& name,
                                          DType dtype,
                                          const std::vector<std::int64_t>& shape) const;
  /// A metadata entry; kBadFormat where it is missing.
  [[nodiscard]] Result<std::string> meta(const std::string& key) const;

 private:
  struct State;
  explicit SafetensorsFile(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State>
      state_;  // shared: a model may keep the map that its views point into
};

struct TensorSpec {
  std::string name;
  DType dtype;
  std::vector<std::int64_t> shape;
};

/// Writes a safetensors file that may be larger than memory: the file is laid out and mapped first,
/// filled by the caller (from several threads, if they write different bytes), then finished.
/// It exists under `path` only after finish() succeeded; otherwise nothing is left. Metadata that
/// are not UTF-8 are stored with U+FFFD for what is not.
class SafetensorsWriter {
 public:
  [[nodiscard]] static Result<SafetensorsWriter> create(
      const std::filesystem::path& path,
      const std::vector<TensorSpec>& tensors,
      const std::map<std::string, std::string>& metadata);
  SafetensorsWriter(SafetensorsWriter&&) noexcept;
  SafetensorsWriter& operator=(SafetensorsWriter&&) noexcept;
  ~SafetensorsWriter();

  template <class T>
  [[nodiscard]] std::span<T> tensor(const std::string& name) {
    const std::span<std::byte> bytes = bytes_of(name, DTypeOf<T>::kValue);
    return {reinterpret_cast<T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
  [[nodiscard]] Status finish();

 private:
  struct State;
  explicit SafetensorsWriter(std::unique_ptr<State> state);
  [[nodiscard]] std::span<std::byte> bytes_of(const std::string& name, DType dtype);
  std::unique_ptr<State> state_;
};

}  // namespace veneer
