// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/rti/rti.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/colour.h"
#include "base/files.h"
#include "base/image_files.h"
#include "base/parallel.h"
#include "btf/importers/crop.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

struct Photo {
  std::string name;
  Direction light;
  int line;  // in the .lp file, for messages
};

std::string lower(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

bool is_picture(const fs::path& path) {
  const std::string extension = lower(path.extension().string());
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png";
}

Result<fs::path> find_lp(const fs::path& source) {
  std::error_code error;
  if (fs::is_regular_file(source, error)) return source;
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(source, error), end; !error && entry != end;
       entry.increment(error)) {
    if (lower(entry->path().extension().string()) == ".lp") found.push_back(entry->path());
  }
  if (error) return fail(Errc::kNotFound, "importing {}: {}", source.string(), error.message());
  if (found.empty())
    return fail(Errc::kNotFound, "importing {}: the folder holds no .lp file", source.string());
  if (found.size() > 1)
    return fail(Errc::kInvalidOption,
                "importing {}: the folder holds {} .lp files; name one of them instead",
                source.string(),
                found.size());
  return found.front();
}

// The last word of `text`, cut off from it.
std::string_view pop_word(std::string_view& text) {
  const std::size_t last = text.find_last_not_of(" \t");
  if (last == std::string_view::npos) return {};
  const std::size_t space = text.find_last_of(" \t", last);
  const std::size_t first = space == std::string_view::npos ? 0 : space + 1;
  const std::string_view word = text.substr(first, last + 1 - first);
  text = text.substr(0, first);
  return word;
}

template <class Number>
bool parse(std::string_view word, Number& value) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc{} && end == word.data() + word.size();
}

// The name may hold spaces: the numbers are the last three words.
Result<Photo> parse_photo(std::string_view line, int number, const std::string& doing) {
  const std::string_view whole = line;
  Photo photo;
  photo.line = number;
  for (Eigen::Index axis = 2; axis >= 0; --axis) {
    if (!parse(pop_word(line), photo.light[axis]) || !std::isfinite(photo.light[axis]))
      return fail(Errc::kBadFormat,
                  "{}: line {}: expected \"name x y z\", found \"{}\"",
                  doing,
                  number,
                  whole);
  }
  const std::size_t end = line.find_last_not_of(" \t");
  const std::size_t begin = line.find_first_not_of(" \t");
  if (end == std::string_view::npos)
    return fail(Errc::kBadFormat, "{}: line {}: the picture has no name", doing, number);
  photo.name = line.substr(begin, end + 1 - begin);
  std::replace(photo.name.begin(), photo.name.end(), '\\', '/');
  constexpr double kZero = 1e-9;  // far below the length of any vector that was measured
  if (photo.light.norm() < kZero)
    return fail(Errc::kBadFormat,
                "{}: line {}: the light of {} is the zero vector",
                doing,
                number,
                photo.name);
  photo.light.normalize();
  if (photo.light.z() < 0.0)
    return fail(Errc::kBadFormat,
                "{}: line {}: the light of {} is below the surface",
                doing,
                number,
                photo.name);
  return photo;
}

Result<std::vector<Photo>> read_lp(const fs::path& lp) {
  const std::string doing = fmt::format("reading {}", lp.string());
  VENEER_ASSIGN(const std::string text, read_text(lp));
  std::vector<Photo> photos;
  int expected = -1;
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.find_first_not_of(" \t") == std::string_view::npos) continue;
    if (expected < 0) {
      std::string_view first = line;
      if (!parse(pop_word(first), expected) || !first.empty() || expected <= 0)
        return fail(Errc::kBadFormat,
                    "{}: line {}: expected the number of pictures, found \"{}\"",
                    doing,
                    number,
                    line);
      continue;
    }
    VENEER_ASSIGN(Photo photo, parse_photo(line, number, doing));
    photos.push_back(std::move(photo));
  }
  if (expected < 0) return fail(Errc::kBadFormat, "{}: the file is empty", doing);
  if (photos.size() != static_cast<std::size_t>(expected))
    return fail(Errc::kBadFormat,
                "{}: the first line states {} pictures, but {} follow",
                doing,
                expected,
                photos.size());
  DirectionSet lights;
  for (const Photo& photo : photos) lights.push_back(photo.light);
  if (const auto equal = find_equal_directions(lights))
    return fail(Errc::kBadFormat,
                "{}: lines {} and {} have the same light; remove one of them",
                doing,
                photos[static_cast<std::size_t>(equal->first)].line,
                photos[static_cast<std::size_t>(equal->second)].line);
  return photos;
}

// Where each picture lies now.
Result<std::vector<fs::path>> find_pictures(const fs::path& folder,
                                            const std::vector<Photo>& photos) {
  std::multimap<std::string, fs::path> by_stem;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (is_picture(entry->path()))
      by_stem.emplace(lower(entry->path().stem().string()), entry->path());
  }
  if (error) return fail(Errc::kIo, "importing {}: {}", folder.string(), error.message());
  std::vector<fs::path> paths;
  for (const Photo& photo : photos) {
    const fs::path written = folder / photo.name;
    if (is_picture(written) && fs::is_regular_file(written, error)) {
      paths.push_back(written);
      continue;
    }
    const auto [begin, end] = by_stem.equal_range(lower(fs::path(photo.name).stem().string()));
    const auto count = std::distance(begin, end);
    if (count == 0)
      return fail(
          Errc::kNotFound,
          "importing {}: there is no picture {} (JPEG or PNG), which line {} of the .lp file names",
          folder.string(),
          photo.name,
          photo.line);
    if (count > 1)
      return fail(Errc::kBadFormat,
                  "importing {}: {} may be {} or {}; keep one of them",
                  folder.string(),
                  photo.name,
                  begin->second.string(),
                  std::next(begin)->second.string());
    paths.push_back(begin->second);
  }
  return paths;
}

Result<Image<Rgb8>> read_picture(const fs::path& path) {
  return lower(path.extension().string()) == ".png" ? read_png(path) : read_jpeg(path);
}

}  // namespace

Status import_rti(const fs::path& source,
                  const fs::path& set,
                  const ImportOptions& options,
                  Progress& progress) {
  const std::string doing = fmt::format("importing {}", source.string());
  VENEER_ASSIGN(const fs::path lp, find_lp(source));
  VENEER_ASSIGN(const std::vector<Photo> photos, read_lp(lp));
  // A bare file name has no parent: its pictures lie in the folder one stands in.
  const fs::path folder = lp.has_parent_path() ? lp.parent_path() : fs::path(".");
  VENEER_ASSIGN(const std::vector<fs::path> paths, find_pictures(folder, photos));
  VENEER_ASSIGN(const Image<Rgb8> first, read_picture(paths.front()));
  const int width = first.width();
  const int height = first.height();
  VENEER_ASSIGN(const Crop crop, crop_of(options, width, height, doing));

  SampleSetInfo info;
  info.width = crop.width;
  info.height = crop.height;
  info.views = {Direction::UnitZ()};
  for (const Photo& photo : photos) info.lights.push_back(photo.light);
  info.source = fmt::format("RTI pictures of {}", lp.filename().string());
  info.licence = "that of the pictures";
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));

  std::array<Eigen::half, 256> linear;
  for (std::size_t i = 0; i < linear.size(); ++i)
    linear[i] = Eigen::half(static_cast<float>(srgb_decode(static_cast<double>(i) / 255.0)));

  progress.start("reading pictures", static_cast<std::int64_t>(photos.size()));
  std::mutex mutex;
  std::optional<std::pair<std::int64_t, Error>>
      failure;  // of the earliest picture, so that it is the same each time
  parallel_for(
      static_cast<std::int64_t>(photos.size()), 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t light = begin; light < end; ++light) {
          const fs::path& path = paths[static_cast<std::size_t>(light)];
          auto picture = read_picture(path);
          if (picture && (picture->width() != width || picture->height() != height)) {
            picture = fail(Errc::kBadFormat,
                           "{}: {} has {} x {} pixels, the first picture {} x {}",
                           doing,
                           path.string(),
                           picture->width(),
                           picture->height(),
                           width,
                           height);
          }
          if (!picture) {
            const std::lock_guard lock(mutex);
            if (!failure || light < failure->first) failure.emplace(light, picture.error());
            continue;
          }
          for (int y = 0; y < crop.height; ++y) {
            for (int x = 0; x < crop.width; ++x) {
              const Rgb8& code = (*picture)(crop.x + x, crop.y + y);
              const std::span<Eigen::half> texel = writer.texel(y * crop.width + x);
              for (std::size_t c = 0; c < 3; ++c)
                texel[static_cast<std::size_t>(light) * 3 + c] = linear[code[c]];
            }
          }
          progress.advance();
        }
      });
  progress.finish();
  if (failure) return tl::unexpected<Error>(failure->second);
  return writer.finish();
}

}  // namespace veneer::btf
