// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2003/pictures.h"

#include <zip.h>

#include <mutex>
#include <utility>

#include "base/files.h"

namespace veneer::btf::ubo2003 {
namespace {

namespace fs = std::filesystem;

// Far above any picture of such a set.
constexpr zip_uint64_t kMostBytes = zip_uint64_t{1} << 28U;
// A file cannot grow by more when it is inflated.
constexpr zip_uint64_t kMostGrowth = 1100;

}  // namespace

struct Pictures::Zip {
  explicit Zip(zip_t* opened) : archive(opened) {}
  Zip(const Zip&) = delete;
  Zip& operator=(const Zip&) = delete;
  ~Zip() { zip_discard(archive); }
  zip_t* archive;
  std::mutex mutex;  // libzip reads one file at a time
};

Result<Pictures> Pictures::open(const fs::path& source) {
  Pictures pictures;
  pictures.source_ = source;
  std::error_code error;
  if (fs::is_directory(source, error)) {
    for (fs::recursive_directory_iterator entry(source, error), end; !error && entry != end;
         entry.increment(error)) {
      pictures.names_.push_back(entry->path().lexically_relative(source).string());
    }
    if (error) return fail(Errc::kIo, "importing {}: {}", source.string(), error.message());
    return pictures;
  }
  if (!fs::exists(source, error))
    return fail(
        Errc::kNotFound, "importing {}: there is no such folder or zip archive", source.string());
  int code = 0;
  zip_t* archive = zip_open(source.c_str(), ZIP_RDONLY, &code);
  if (archive == nullptr) {
    zip_error_t what;
    zip_error_init_with_code(&what, code);
    const std::string text = zip_error_strerror(&what);
    zip_error_fini(&what);
    return fail(Errc::kBadFormat, "importing {}: {}", source.string(), text);
  }
  pictures.zip_ = std::make_shared<Zip>(archive);
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* name = zip_get_name(archive, static_cast<zip_uint64_t>(i), 0);
    pictures.names_.emplace_back(name == nullptr ? "" : name);
  }
  return pictures;
}

Result<std::string> Pictures::bytes(std::size_t index) const {
  const std::string& name = names_[index];
  if (!zip_) return read_text(source_ / name);
  const auto damaged = [&](std::string_view what) {
    return fail(Errc::kBadFormat, "reading {} in {}: {}", name, source_.string(), what);
  };
  const std::lock_guard lock(zip_->mutex);
  zip_stat_t info;
  zip_stat_init(&info);
  if (zip_stat_index(zip_->archive, index, 0, &info) != 0 || (info.valid & ZIP_STAT_SIZE) == 0 ||
      (info.valid & ZIP_STAT_COMP_SIZE) == 0)
    return damaged("the archive does not state its size");
  if (info.size > kMostBytes || info.size / kMostGrowth > info.comp_size)
    return damaged(fmt::format("it claims {} bytes", info.size));
  const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file(
      zip_fopen_index(zip_->archive, index, 0), &zip_fclose);
  if (!file) return damaged(zip_strerror(zip_->archive));
  std::string bytes(info.size, '\0');
  char more = 0;
  // The byte too many makes libzip look at the end, where it compares the checksum.
  if (zip_fread(file.get(), bytes.data(), bytes.size()) != static_cast<zip_int64_t>(info.size) ||
      zip_fread(file.get(), &more, 1) != 0)
    return damaged("it is damaged or was cut short");
  return bytes;
}

}  // namespace veneer::btf::ubo2003
