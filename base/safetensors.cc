// SPDX-License-Identifier: Apache-2.0
#include "base/safetensors.h"

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>

#include "base/files.h"
#include "base/unique_handle.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct DTypeInfo {
  DType dtype;
  std::string_view name;
  std::size_t size;
};
constexpr std::array kDTypes{
    DTypeInfo{DType::kU8, "U8", 1},
    DTypeInfo{DType::kU16, "U16", 2},
    DTypeInfo{DType::kI32, "I32", 4},
    DTypeInfo{DType::kF16, "F16", 2},
    DTypeInfo{DType::kF32, "F32", 4},
    DTypeInfo{DType::kF64, "F64", 8},
};

constexpr std::size_t kAlignment = 8;      // of every tensor, so that any type can be read in place
constexpr std::uint64_t kLengthBytes = 8;  // the u64 before the header
constexpr std::uint64_t kMaxHeader = 100'000'000;  // the format's own limit

std::string shape_text(const std::vector<std::int64_t>& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text +=
        fmt::format("{}{}", i == 0 ? "" : " x ", shape[i] < 0 ? "any" : std::to_string(shape[i]));
  }
  return text + "]";
}

/// Number of elements; nothing where it is negative or overflows.
std::optional<std::uint64_t> element_count(const std::vector<std::int64_t>& shape) {
  std::uint64_t count = 1;
  for (const std::int64_t extent : shape) {
    if (extent < 0) return std::nullopt;
    if (__builtin_mul_overflow(count, static_cast<std::uint64_t>(extent), &count))
      return std::nullopt;
  }
  return count;
}

bool is_size(const json& number) {
  return number.is_number_unsigned() &&
         number.get<std::uint64_t>() <= std::uint64_t{std::numeric_limits<std::int64_t>::max()};
}

/// A mapped file.
struct Map {
  std::byte* data = nullptr;
  std::size_t size = 0;
  Map() = default;
  Map(const Map&) = delete;
  Map& operator=(const Map&) = delete;
  ~Map() { unmap(); }
  void unmap() {
    if (data != nullptr) ::munmap(data, size);
    data = nullptr;
  }
};

}  // namespace

std::size_t size_of(DType dtype) {
  return std::ranges::find(kDTypes, dtype, &DTypeInfo::dtype)->size;
}
std::string_view name_of(DType dtype) {
  return std::ranges::find(kDTypes, dtype, &DTypeInfo::dtype)->name;
}

std::int64_t TensorView::count() const {
  return std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>());
}

struct SafetensorsFile::State {
  fs::path path;
  Map map;
  std::map<std::string, std::string> metadata;
  std::map<std::string, TensorView> tensors;

  Status parse_tensor(const std::string& name, const json& entry, std::span<const std::byte> body);
  Status check_layout(std::span<const std::byte> body) const;
};

Status SafetensorsFile::State::parse_tensor(const std::string& name,
                                            const json& entry,
                                            std::span<const std::byte> body) {
  const auto bad = [&](std::string_view why) {
    return fail(Errc::kBadFormat, "reading {}: tensor {}: {}", path.string(), name, why);
  };
  if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") ||
      !entry.contains("data_offsets")) {
    return bad("its header entry is incomplete");
  }
  const auto dtype_name = entry["dtype"].get<std::string>();
  const auto* dtype = std::ranges::find(kDTypes, dtype_name, &DTypeInfo::name);
  if (dtype == kDTypes.end())
    return bad(fmt::format("its type {} is not one that Veneer reads", dtype_name));
  // The library turns 1e30 into an integer by a cast, which is undefined.
  for (const char* key : {"shape", "data_offsets"}) {
    const json& numbers = entry[key];
    if (!numbers.is_array() || !std::ranges::all_of(numbers, &is_size))
      return bad(fmt::format(
          "its {} should be a list of whole numbers from 0 to 2^63 - 1; write the file again",
          key));
  }
  TensorView view{dtype->dtype, entry["shape"].get<std::vector<std::int64_t>>(), {}};
  const auto offsets = entry["data_offsets"].get<std::vector<std::uint64_t>>();
  if (offsets.size() != 2 || offsets[0] > offsets[1]) return bad("its offsets make no sense");
  if (offsets[1] > body.size()) {
    return bad(
        fmt::format("it ends at byte {} of {}: the file was cut short; write or copy it again",
                    offsets[1],
                    body.size()));
  }
  const std::optional<std::uint64_t> count = element_count(view.shape);
  const std::uint64_t bytes = offsets[1] - offsets[0];
  if (!count || bytes % dtype->size != 0 || bytes / dtype->size != *count) {
    return bad(fmt::format(
        "its {} bytes do not fit the shape {} of {}", bytes, shape_text(view.shape), dtype_name));
  }
  view.bytes = body.subspan(offsets[0], bytes);
  if (reinterpret_cast<std::uintptr_t>(view.bytes.data()) % dtype->size != 0) {
    return bad(
        "its data are not aligned to their type; write the file again with an aligned header");
  }
  tensors.emplace(name, std::move(view));
  return {};
}

/// The tensors fill the body without overlap, hole or remainder, as the format demands.
Status SafetensorsFile::State::check_layout(std::span<const std::byte> body) const {
  struct Extent {
    std::ptrdiff_t begin;
    std::ptrdiff_t end;
    const std::string* name;
  };
  std::vector<Extent> extents;
  extents.reserve(tensors.size());
  for (const auto& [name, view] : tensors) {
    const std::ptrdiff_t begin = view.bytes.data() - body.data();
    extents.push_back({begin, begin + std::ssize(view.bytes), &name});
  }
  std::ranges::sort(
      extents, {}, [](const Extent& extent) { return std::pair(extent.begin, extent.end); });
  std::ptrdiff_t reached = 0;
  for (const Extent& extent : extents) {
    if (extent.begin != reached) {
      return fail(Errc::kBadFormat,
                  "reading {}: tensor {} begins at byte {} where {} should follow: the tensors "
                  "overlap or leave a hole; write the file again",
                  path.string(),
                  *extent.name,
                  extent.begin,
                  reached);
    }
    reached = extent.end;
  }
  if (reached != std::ssize(body)) {
    return fail(Errc::kBadFormat,
                "reading {}: {} bytes follow its last tensor; write or copy it again",
                path.string(),
                std::ssize(body) - reached);
  }
  return {};
}

Result<SafetensorsFile> SafetensorsFile::open(const fs::path& path) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) {
    return fail(errno == ENOENT ? Errc::kNotFound : Errc::kIo,
                "reading {}: {}",
                path.string(),
                std::strerror(errno));
  }
  struct stat info {};
  if (::fstat(fd.value(), &info) != 0 || !S_ISREG(info.st_mode)) {
    return fail(Errc::kIo, "reading {}: it is no regular file", path.string());
  }
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size < kLengthBytes) {
    return fail(Errc::kBadFormat,
                "reading {}: {} bytes are too few for a safetensors file",
                path.string(),
                size);
  }
  auto state = std::make_shared<State>();
  state->path = path;
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd.value(), 0);
  if (data == MAP_FAILED)
    return fail(Errc::kIo, "mapping {}: {}", path.string(), std::strerror(errno));
  state->map.data = static_cast<std::byte*>(data);
  state->map.size = size;

  std::uint64_t header_length = 0;
  std::memcpy(&header_length, data, kLengthBytes);  // little endian, as this machine
  if (header_length > kMaxHeader || header_length > size - kLengthBytes) {
    return fail(Errc::kBadFormat,
                "reading {}: its header should have {} bytes, the file has {}: no safetensors "
                "file, or cut short",
                path.string(),
                header_length,
                size);
  }
  const auto* text = reinterpret_cast<const char*>(state->map.data) + kLengthBytes;
  const std::span<const std::byte> body(state->map.data + kLengthBytes + header_length,
                                        size - kLengthBytes - header_length);
  try {
    const json header = json::parse(text, text + header_length);
    for (const auto& [name, entry] : header.items()) {
      if (name == "__metadata__") {
        state->metadata = entry.get<std::map<std::string, std::string>>();
      } else {
        VENEER_TRY(state->parse_tensor(name, entry, body));
      }
    }
  } catch (const json::exception& error) {
    return fail(Errc::kBadFormat, "reading the header of {}: {}", path.string(), error.what());
  }
  VENEER_TRY(state->check_layout(body));
  return SafetensorsFile(std::move(state));
}

const fs::path& SafetensorsFile::path() const { return state_->path; }
const std::map<std::string, std::string>& SafetensorsFile::metadata() const {
  return state_->metadata;
}
bool SafetensorsFile::contains(const std::string& name) const {
  return state_->tensors.contains(name);
}

std::vector<std::string> SafetensorsFile::names() const {
  std::vector<std::string> names;
  for (const auto& [name, view] : state_->tensors) names.push_back(name);
  return names;
}

Result<TensorView> SafetensorsFile::tensor(const std::string& name,
                                           DType dtype,
                                           const std::vector<std::int64_t>& shape) const {
  const auto found = state_->tensors.find(name);
  if (found == state_->tensors.end()) {
    return fail(Errc::kBadFormat, "reading {}: it has no tensor {}", state_->path.string(), name);
  }
  const TensorView& view = found->second;
  const bool fits =
      shape.empty() || std::ranges::equal(view.shape, shape, [](auto is, auto should) {
        return should < 0 || is == should;
      });
  if (view.dtype != dtype || !fits) {
    return fail(Errc::kBadFormat,
                "reading {}: tensor {} is {} {}, expected {} {}",
                state_->path.string(),
                name,
                name_of(view.dtype),
                shape_text(view.shape),
                name_of(dtype),
                shape_text(shape));
  }
  return view;
}

Result<std::string> SafetensorsFile::meta(const std::string& key) const {
  const auto found = state_->metadata.find(key);
  if (found == state_->metadata.end()) {
    return fail(
        Errc::kBadFormat, "reading {}: its metadata lack \"{}\"", state_->path.string(), key);
  }
  return found->second;
}

struct SafetensorsWriter::State {
  explicit State(StagedFile file) : staged(std::move(file)) {}
  StagedFile staged;  // removed last, after the map is gone
  Map map;
  struct Place {
    DType dtype;
    std::span<std::byte> bytes;
  };
  std::map<std::string, Place> places;
};

SafetensorsWriter::SafetensorsWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SafetensorsWriter::SafetensorsWriter(SafetensorsWriter&&) noexcept = default;
SafetensorsWriter& SafetensorsWriter::operator=(SafetensorsWriter&&) noexcept = default;
SafetensorsWriter::~SafetensorsWriter() = default;

Result<SafetensorsWriter> SafetensorsWriter::create(
    const fs::path& path,
    const std::vector<TensorSpec>& tensors,
    const std::map<std::string, std::string>& metadata) {
  json header = json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  std::uint64_t offset = 0;
  for (const TensorSpec& spec : tensors) {
    const std::optional<std::uint64_t> count = element_count(spec.shape);
    if (!count)
      return fail(Errc::kInvalidOption,
                  "writing {}: tensor {} has an impossible shape",
                  path.string(),
                  spec.name);
    VENEER_CHECK(!header.contains(spec.name));
    const std::uint64_t end = offset + *count * size_of(spec.dtype);
    header[spec.name] = {{"dtype", std::string(name_of(spec.dtype))},
                         {"shape", spec.shape},
                         {"data_offsets", {offset, end}}};
    // The format allows no holes, so a tensor of odd size is refused rather than misaligning the
    // next.
    VENEER_CHECK(end % kAlignment == 0 || &spec == &tensors.back() ||
                 end % size_of((&spec + 1)->dtype) == 0);
    offset = end;
  }
  // Paths and remarks need not be UTF-8, JSON must be: what is not becomes U+FFFD.
  std::string text = header.dump(-1, ' ', false, json::error_handler_t::replace);
  text.append((kAlignment - text.size() % kAlignment) % kAlignment, ' ');

  VENEER_ASSIGN(StagedFile staged, StagedFile::create(path));
  auto state = std::make_unique<State>(std::move(staged));
  const UniqueFd fd(::open(state->staged.path().c_str(), O_RDWR | O_CLOEXEC));
  const std::size_t size = kLengthBytes + text.size() + offset;
  // posix_fallocate, not ftruncate: a full disk must show here and not as SIGBUS while filling.
  const int error = !fd ? errno : ::posix_fallocate(fd.value(), 0, static_cast<off_t>(size));
  if (error != 0) {
    return fail(
        Errc::kIo, "writing {} ({} MB): {}", path.string(), size / 1'000'000, std::strerror(error));
  }
  void* data = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd.value(), 0);
  if (data == MAP_FAILED)
    return fail(Errc::kIo, "mapping {}: {}", path.string(), std::strerror(errno));
  state->map.data = static_cast<std::byte*>(data);
  state->map.size = size;
  const std::uint64_t header_length = text.size();
  std::memcpy(data, &header_length, kLengthBytes);
  std::memcpy(state->map.data + kLengthBytes, text.data(), text.size());
  std::byte* next = state->map.data + kLengthBytes + text.size();
  for (const TensorSpec& spec : tensors) {
    const std::size_t bytes = *element_count(spec.shape) * size_of(spec.dtype);
    state->places.emplace(spec.name, State::Place{spec.dtype, {next, bytes}});
    next += bytes;
  }
  return SafetensorsWriter(std::move(state));
}

std::span<std::byte> SafetensorsWriter::bytes_of(const std::string& name, DType dtype) {
  const auto found = state_->places.find(name);
  VENEER_CHECK(found != state_->places.end() && found->second.dtype == dtype);
  return found->second.bytes;
}

Status SafetensorsWriter::finish() {
  if (::msync(state_->map.data, state_->map.size, MS_SYNC) != 0) {
    return fail(Errc::kIo, "writing {}: {}", state_->staged.path().string(), std::strerror(errno));
  }
  state_->map.unmap();
  return state_->staged.commit();
}

}  // namespace veneer
