// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2003/ubo2003.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/image_files.h"
#include "base/parallel.h"
#include "btf/importers/crop.h"
#include "btf/importers/ubo2003/pictures.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

using ubo2003::Pictures;

constexpr double kGamma = 2.2;
constexpr std::size_t kBandBytes = std::size_t{1} << 30U;

using WholeDegrees = std::pair<int, int>;            // theta, phi
using Pair = std::pair<WholeDegrees, WholeDegrees>;  // view, light

// The number after `tag`, which must come before any other digit. Cuts off what was read.
std::optional<int> number_after(std::string_view& text, std::string_view tag) {
  const std::size_t digits = std::min(text.find_first_of("0123456789"), text.size());
  std::string_view before = text.substr(0, digits);
  while (before.ends_with(' ')) before.remove_suffix(1);
  if (!before.ends_with(tag)) return {};
  int value = 0;
  const auto [end, error] = std::from_chars(text.data() + digits, text.data() + text.size(), value);
  if (error != std::errc{}) return {};
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

// The directions that a file's name tells, if it does.
std::optional<Pair> pair_of(const std::string& path) {
  std::string name = path.substr(path.find_last_of("/\\") + 1);
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  // Those that begin with a dot are what some systems add to each file of an archive.
  if (name.starts_with('.') || !(name.ends_with(".jpg") || name.ends_with(".jpeg"))) return {};
  for (std::size_t at = name.find("tl"); at != std::string::npos; at = name.find("tl", at + 1)) {
    std::string_view rest = std::string_view(name).substr(at);
    std::array<int, 4> angles{};
    bool good = true;
    constexpr std::array<std::string_view, 4> kTags{"tl", "pl", "tv", "pv"};
    for (std::size_t i = 0; good && i < 4; ++i) {
      const auto angle = number_after(rest, kTags[i]);
      good = angle && *angle <= (i % 2 == 0 ? 90 : 360);
      if (good) angles[i] = *angle;
    }
    if (!good) continue;
    const auto direction = [](int theta, int phi) {
      return WholeDegrees(theta, theta == 0 ? 0 : phi % 360);
    };
    return Pair(direction(angles[2], angles[3]), direction(angles[0], angles[1]));
  }
  return {};
}

DirectionSet directions_of(const std::set<WholeDegrees>& degrees) {
  DirectionSet directions;
  constexpr double kRadians = std::numbers::pi / 180.0;
  for (const auto& [theta, phi] : degrees)
    directions.push_back(direction_from_angles({theta * kRadians, phi * kRadians}));
  return directions;
}

// Which file shows each pair, [view][light].
struct Catalogue {
  DirectionSet views;
  DirectionSet lights;
  std::vector<std::size_t> files;
};

Result<Catalogue> catalogue_of(const Pictures& pictures, const std::string& doing) {
  std::map<Pair, std::size_t> found;
  std::set<WholeDegrees> views;
  std::set<WholeDegrees> lights;
  for (std::size_t i = 0; i < pictures.names().size(); ++i) {
    const auto pair = pair_of(pictures.names()[i]);
    if (!pair) continue;
    const auto [before, is_new] = found.emplace(*pair, i);
    if (!is_new)
      return fail(Errc::kBadFormat,
                  "{}: {} and {} show the same pair of directions; remove one of them",
                  doing,
                  pictures.names()[before->second],
                  pictures.names()[i]);
    views.insert(pair->first);
    lights.insert(pair->second);
  }
  if (found.empty())
    return fail(
        Errc::kBadFormat,
        "{}: it holds no picture with a name like \"tl000 pl000 tv000 pv000.jpg\"; Radiance "
        "pictures (.hdr) cannot be imported",
        doing);
  Catalogue catalogue;
  for (const WholeDegrees& view : views) {
    for (const WholeDegrees& light : lights) {
      const auto file = found.find({view, light});
      if (file == found.end())
        return fail(Errc::kBadFormat,
                    "{}: the picture tl{:03} pl{:03} tv{:03} pv{:03}.jpg is missing ({} of {} are "
                    "there)",
                    doing,
                    light.first,
                    light.second,
                    view.first,
                    view.second,
                    found.size(),
                    views.size() * lights.size());
      catalogue.files.push_back(file->second);
    }
  }
  catalogue.views = directions_of(views);
  catalogue.lights = directions_of(lights);
  return catalogue;
}

Result<Image<Rgb8>> read_picture(const Pictures& pictures, std::size_t file) {
  VENEER_ASSIGN(const std::string bytes, pictures.bytes(file));
  return decode_jpeg(bytes, pictures.names()[file]);
}

// Some rows of every picture, [pair][texel].
class Band {
 public:
  Band(const Pictures& pictures, const std::vector<std::size_t>& files, int width, int height)
      : pictures_(pictures), files_(files), width_(width), height_(height) {}

  Status read(const Crop& rows, const std::string& doing, Progress& progress) {
    texels_ = static_cast<std::size_t>(rows.width) * static_cast<std::size_t>(rows.height);
    pixels_.resize(files_.size() * texels_);
    std::mutex mutex;
    // Of the first picture, so that it is the same each time.
    std::optional<std::pair<std::int64_t, Error>> failure;
    const auto count = static_cast<std::int64_t>(files_.size());
    parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t pair = begin; pair < end; ++pair) {
        const std::size_t file = files_[static_cast<std::size_t>(pair)];
        auto picture = read_picture(pictures_, file);
        if (picture && (picture->width() != width_ || picture->height() != height_))
          picture = fail(Errc::kBadFormat,
                         "{} has {} x {} pixels, the first picture {} x {}",
                         pictures_.names()[file],
                         picture->width(),
                         picture->height(),
                         width_,
                         height_);
        if (!picture) {
          const std::lock_guard lock(mutex);
          if (!failure || pair < failure->first) failure.emplace(pair, picture.error());
          continue;
        }
        Rgb8* out = &pixels_[static_cast<std::size_t>(pair) * texels_];
        for (int y = rows.y; y < rows.y + rows.height; ++y)
          out = std::copy_n(&(*picture)(rows.x, y), rows.width, out);
        progress.advance();
      }
    });
    if (failure) return fail_while(doing, failure->second);
    return {};
  }

  // A piece of texels at a time reads whole cache lines of each picture.
  void write(SampleSetWriter& writer, int first_texel) const {
    std::array<Eigen::half, 256> linear;
    for (std::size_t code = 0; code < linear.size(); ++code)
      linear[code] =
          Eigen::half(static_cast<float>(std::pow(static_cast<double>(code) / 255.0, kGamma)));
    parallel_for(static_cast<std::int64_t>(texels_), 32, [&](std::int64_t begin, std::int64_t end) {
      for (std::size_t pair = 0; pair < files_.size(); ++pair) {
        for (std::int64_t texel = begin; texel < end; ++texel) {
          const Rgb8& code = pixels_[pair * texels_ + static_cast<std::size_t>(texel)];
          const std::span<Eigen::half> out =
              writer.texel(first_texel + static_cast<int>(texel)).subspan(3 * pair, 3);
          for (std::size_t c = 0; c < 3; ++c) out[c] = linear[code[c]];
        }
      }
    });
  }

 private:
  const Pictures& pictures_;
  const std::vector<std::size_t>& files_;
  int width_;  // of every picture
  int height_;
  std::size_t texels_ = 0;
  std::vector<Rgb8> pixels_;
};

}  // namespace

Status import_ubo2003(const std::filesystem::path& source,
                      const std::filesystem::path& set,
                      const ImportOptions& options,
                      Progress& progress) {
  const std::string doing = fmt::format("importing {}", source.string());
  VENEER_ASSIGN(const Pictures pictures, Pictures::open(source));
  VENEER_ASSIGN(const Catalogue catalogue, catalogue_of(pictures, doing));
  const auto first = read_picture(pictures, catalogue.files.front());
  if (!first) return fail_while(doing, first.error());
  VENEER_ASSIGN(const Crop crop, crop_of(options, first->width(), first->height(), doing));

  SampleSetInfo info;
  info.width = crop.width;
  info.height = crop.height;
  info.views = catalogue.views;
  info.lights = catalogue.lights;
  info.source = fmt::format("BTF pictures of {}", (source / "").parent_path().filename().string());
  info.licence = "that of the pictures (measurements of the University of Bonn: research use)";
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));

  const std::size_t row_bytes =
      catalogue.files.size() * static_cast<std::size_t>(crop.width) * sizeof(Rgb8);
  const int rows = static_cast<int>(
      std::clamp<std::size_t>(kBandBytes / row_bytes, 1, static_cast<std::size_t>(crop.height)));
  const int bands = (crop.height + rows - 1) / rows;
  progress.start("reading pictures", static_cast<std::int64_t>(catalogue.files.size()) * bands);
  Band band(pictures, catalogue.files, first->width(), first->height());
  for (int y = 0; y < crop.height; y += rows) {
    const Crop part{crop.x, crop.y + y, crop.width, std::min(rows, crop.height - y)};
    VENEER_TRY(band.read(part, doing, progress));
    band.write(writer, y * crop.width);
  }
  progress.finish();
  return writer.finish();
}

}  // namespace veneer::btf
