// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/folder/series.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <system_error>

#include "base/files.h"
#include "capture/cameras/folder/picture_file.h"

namespace veneer::capture {
namespace {

constexpr std::string_view kExposuresName = "exposures.csv";

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Seconds, as a decimal or a fraction; none where they are not finite and above 0.
std::optional<double> seconds_in(std::string_view text) {
  const std::size_t slash = text.find('/');
  std::optional<double> value = number(trimmed(text.substr(0, slash)));
  if (value && slash != std::string_view::npos) {
    const std::optional<double> divisor = number(trimmed(text.substr(slash + 1)));
    if (!divisor) return std::nullopt;
    *value /= *divisor;
  }
  if (!value || !std::isfinite(*value) || *value <= 0) return std::nullopt;
  return value;
}

Result<std::map<std::string, double>> read_exposures(const std::filesystem::path& path) {
  VENEER_ASSIGN(const std::string text, read_text(path));
  std::map<std::string, double> exposures;
  int line_number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(at, end - at));
    at = end + 1;
    ++line_number;
    if (line.empty() || (line_number == 1 && line.starts_with("file"))) continue;
    const std::size_t comma = line.rfind(',');
    const auto seconds = comma == std::string_view::npos
                             ? std::nullopt
                             : seconds_in(trimmed(line.substr(comma + 1)));
    if (!seconds) {
      return fail(
          Errc::kBadFormat,
          "reading {}: line {} is \"{}\"; write a picture's name, a comma, and its exposure "
          "in seconds: IMG_0001.tiff,1/60",
          path.string(),
          line_number,
          line);
    }
    const auto added = exposures.emplace(trimmed(line.substr(0, comma)), *seconds);
    if (!added.second) {
      return fail(Errc::kBadFormat,
                  "reading {}: line {} names {} a second time; remove one of the two",
                  path.string(),
                  line_number,
                  added.first->first);
    }
  }
  return exposures;
}

struct Found {
  std::vector<std::filesystem::path> linear, encoded, raw;
};

Result<Found> look_into(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::directory_iterator entries(folder, error);
  if (error) {
    return fail(Errc::kNotFound,
                "opening the camera: the folder {} cannot be read: {}; set path to the folder of "
                "the pictures",
                folder.string(),
                error.message());
  }
  Found found;
  for (; entries != std::filesystem::directory_iterator{}; entries.increment(error)) {
    if (error) return fail(Errc::kIo, "reading {}: {}", folder.string(), error.message());
    const std::filesystem::path& path = entries->path();
    // What begins with a dot is a file manager's own ("._IMG_0001.tiff").
    if (path.filename().string().starts_with('.')) continue;
    switch (kind_of(path)) {
      case PictureKind::kNone:
        break;
      case PictureKind::kLinear:
        found.linear.push_back(path);
        break;
      case PictureKind::kEncoded:
        found.encoded.push_back(path);
        break;
      case PictureKind::kRaw:
        found.raw.push_back(path);
        break;
    }
  }
  return found;
}

Result<std::vector<std::filesystem::path>> choose(Found found,
                                                  const std::filesystem::path& folder,
                                                  bool allow_encoded) {
  if (allow_encoded && !found.encoded.empty() && !found.linear.empty()) {
    return fail(Errc::kInvalidOption,
                "opening the camera: {} has {} JPEG and {} other pictures, and allow_encoded takes "
                "both; leave allow_encoded out, or move one kind to another folder",
                folder.string(),
                found.encoded.size(),
                found.linear.size());
  }
  if (!found.linear.empty()) return found.linear;
  if (!found.encoded.empty() && allow_encoded) return found.encoded;
  if (!found.raw.empty()) {
    return fail(
        Errc::kNotFound,
        "opening the camera: {} has only RAW pictures ({}, for one); convert them to linear "
        "16-bit TIFF first, all alike: dcraw -4 -T -t 0 -o 0 -r 1 1 1 1 FILES",
        folder.string(),
        found.raw.front().filename().string());
  }
  if (!found.encoded.empty()) {
    return fail(Errc::kInvalidOption,
                "opening the camera: {} has only JPEG, whose values are not proportional to light; "
                "convert the RAW pictures to 16-bit TIFF instead, or set allow_encoded = true if "
                "the camera's response is known",
                folder.string());
  }
  return fail(Errc::kNotFound,
              "opening the camera: {} has no PNG, TIFF or EXR; set path to the folder of the "
              "pictures",
              folder.string());
}

}  // namespace

Result<std::vector<SeriesPicture>> find_series(const std::filesystem::path& folder,
                                               std::optional<double> exposure_s,
                                               bool allow_encoded) {
  VENEER_ASSIGN(Found found, look_into(folder));
  VENEER_ASSIGN(std::vector<std::filesystem::path> paths,
                choose(std::move(found), folder, allow_encoded));
  std::ranges::sort(paths);

  const std::filesystem::path list = folder / kExposuresName;
  std::error_code ignored;
  const bool listed = std::filesystem::exists(list, ignored);
  std::map<std::string, double> exposures;
  if (listed) {
    VENEER_ASSIGN(exposures, read_exposures(list));
  }
  if (exposure_s && (!std::isfinite(*exposure_s) || *exposure_s <= 0)) {
    return fail(Errc::kInvalidOption,
                "opening the camera: exposure_s is {}; it must be above 0",
                *exposure_s);
  }

  std::vector<SeriesPicture> series;
  for (std::filesystem::path& path : paths) {
    double seconds = 0;
    if (!listed) {
      const std::optional<double> said = exposure_of(path);
      if (!said && !exposure_s) {
        return fail(
            Errc::kInvalidOption,
            "opening the camera: {} does not say how long it was exposed; set exposure_s if "
            "all are alike, or put {} beside them: a line \"file,exposure_s\", then for each "
            "picture \"{},1/60\"",
            path.string(),
            kExposuresName,
            path.filename().string());
      }
      seconds = said ? *said : *exposure_s;
    } else {
      const auto entry = exposures.find(path.filename().string());
      if (entry == exposures.end()) {
        return fail(Errc::kBadFormat,
                    "reading {}: it has no line for {}; add one, or move that picture away",
                    list.string(),
                    path.filename().string());
      }
      seconds = entry->second;
      exposures.erase(entry);
    }
    series.push_back({std::move(path), seconds});
  }
  if (!exposures.empty()) {
    return fail(Errc::kBadFormat,
                "reading {}: it names {}, which is not in the folder; remove the line, or put the "
                "picture there",
                list.string(),
                exposures.begin()->first);
  }
  return series;
}

}  // namespace veneer::capture
