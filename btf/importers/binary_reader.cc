// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/binary_reader.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <cerrno>
#include <limits>
#include <system_error>

#include "base/unique_handle.h"

namespace veneer::btf {

std::uint64_t saturating_product(std::initializer_list<std::uint64_t> factors) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t product = 1;
  bool overflow = false;
  for (const std::uint64_t factor : factors) {
    if (factor == 0) return 0;
    overflow = overflow || product > kMost / factor;
    product = overflow ? kMost : product * factor;
  }
  return product;
}

Result<BinaryFile> BinaryFile::open(const std::filesystem::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd)
    return fail(
        Errc::kNotFound, "reading {}: {}", path.string(), std::generic_category().message(errno));
  struct stat info {};
  if (::fstat(fd.value(), &info) != 0 || !S_ISREG(info.st_mode))
    return fail(Errc::kBadFormat, "reading {}: it is no file", path.string());
  if (info.st_size == 0)
    return fail(Errc::kBadFormat, "reading {}: the file is empty", path.string());
  const auto size = static_cast<std::size_t>(info.st_size);
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd.value(), 0);
  if (data == MAP_FAILED)
    return fail(Errc::kIo, "reading {}: {}", path.string(), std::generic_category().message(errno));
  BinaryFile file;
  file.mapping_ = std::shared_ptr<const void>(
      data, [size](const void* mapping) { ::munmap(const_cast<void*>(mapping), size); });
  file.bytes_ = {static_cast<const std::byte*>(data), size};
  return file;
}

Result<std::span<const std::byte>> BinaryReader::take(std::initializer_list<std::uint64_t> counts,
                                                      std::string_view what) {
  const std::uint64_t count = saturating_product(counts);
  if (count > rest_.size())
    return damaged(
        "{} should follow at byte {}, but only {} bytes are left: the file was cut "
        "short, or its header is damaged",
        what,
        position(),
        rest_.size());
  const auto taken = rest_.first(static_cast<std::size_t>(count));
  rest_ = rest_.subspan(static_cast<std::size_t>(count));
  return taken;
}

Status BinaryReader::expect_end() const {
  if (rest_.empty()) return {};
  return damaged("{} bytes follow after its last field", rest_.size());
}

}  // namespace veneer::btf
