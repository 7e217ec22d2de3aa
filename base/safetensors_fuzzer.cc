// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstring>

#include "base/safetensors.h"
#include "base/testing/fuzzing.h"
#include "base/testing/memory_file.h"

namespace veneer {
namespace {

/// What is accepted is inside the file, aligned, and as large as its shape says.
Verdict read(std::string_view bytes) {
  static const MemoryFile kFile;
  kFile.write(bytes);
  const auto file = SafetensorsFile::open(kFile.path());
  if (!file) return refused(file.error());
  std::size_t sum = 0;
  for (const std::string& name : file->names()) {
    for (const DType dtype :
         {DType::kU8, DType::kU16, DType::kI32, DType::kF16, DType::kF32, DType::kF64}) {
      const auto tensor = file->tensor(name, dtype, {});
      if (!tensor) continue;
      if (static_cast<std::size_t>(tensor->count()) * size_of(dtype) != tensor->bytes.size())
        return accepted("a tensor that does not fit its shape");
      if (reinterpret_cast<std::uintptr_t>(tensor->bytes.data()) % size_of(dtype) != 0)
        return accepted("a tensor that is not aligned");
      sum += tensor->bytes.size();
      // The sanitizer looks whether each byte is there.
      std::size_t ones = 0;
      for (const std::byte byte : tensor->bytes) ones += byte == std::byte{1} ? 1 : 0;
      if (ones > tensor->bytes.size()) return accepted("more ones than bytes");
    }
  }
  return accepted(sum <= bytes.size() ? "" : "tensors that overlap");
}

std::string file_of(std::string header, std::size_t body) {
  header.append((8 - header.size() % 8) % 8, ' ');
  std::string text(8, '\0');
  const std::uint64_t length = header.size();
  std::memcpy(text.data(), &length, sizeof(length));
  return text + header + std::string(body, '\1');
}

}  // namespace

const FuzzedReader& fuzzed_reader() {
  static const FuzzedReader kReader{
      &read,
      {file_of(R"({"a":{"dtype":"F64","shape":[1,2],"data_offsets":[0,16]},)"
               R"("b":{"dtype":"U8","shape":[3],"data_offsets":[16,19]},"__metadata__":{"k":"v"}})",
               19),
       file_of(R"({"a":{"dtype":"F16","shape":[0,9223372036854775807],"data_offsets":[0,0]}})", 0),
       file_of(R"({"a":{"dtype":"I32","shape":[],"data_offsets":[0,4]}})", 4)},
      {1024, 80},
      {file_of(R"({"a":{"dtype":"F16","shape":[720368542036854775807],"data_offsets":[0,0]}})",
               0)}};
  return kReader;
}

}  // namespace veneer
