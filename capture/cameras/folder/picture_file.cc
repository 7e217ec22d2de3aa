// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/folder/picture_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/image_files.h"
#include "capture/cameras/folder/tiff_file.h"

namespace veneer::capture {
namespace {

constexpr std::array<std::pair<std::string_view, PictureKind>, 18> kEndings{{
    {".png", PictureKind::kLinear},
    {".tif", PictureKind::kLinear},
    {".tiff", PictureKind::kLinear},
    {".exr", PictureKind::kLinear},
    {".jpg", PictureKind::kEncoded},
    {".jpeg", PictureKind::kEncoded},
    {".3fr", PictureKind::kRaw},
    {".arw", PictureKind::kRaw},
    {".cr2", PictureKind::kRaw},
    {".cr3", PictureKind::kRaw},
    {".dng", PictureKind::kRaw},
    {".iiq", PictureKind::kRaw},
    {".nef", PictureKind::kRaw},
    {".orf", PictureKind::kRaw},
    {".pef", PictureKind::kRaw},
    {".raf", PictureKind::kRaw},
    {".rw2", PictureKind::kRaw},
    {".srw", PictureKind::kRaw},
}};

std::string ending_of(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return ending;
}

PictureCounts from_8_bits(const Image<Rgb8>& picture, std::uint16_t full_scale) {
  PictureCounts result{Image<Rgb16>(picture.width(), picture.height()),
                       full_scale == 0 ? std::uint16_t{255} : full_scale};
  std::ranges::transform(picture.pixels(), result.counts.pixels().begin(), [](const Rgb8& p) {
    return Rgb16{p[0], p[1], p[2]};
  });
  return result;
}

/// Counts of a float picture in which 1 is full scale.
Result<std::uint16_t> count_of(float value,
                               std::uint16_t full_scale,
                               const std::filesystem::path& path) {
  if (!std::isfinite(value)) {
    return fail(Errc::kBadFormat,
                "reading {}: it has values that are no finite numbers; convert it again",
                path.string());
  }
  return static_cast<std::uint16_t>(
      std::lround(std::clamp(value, 0.0F, 1.0F) * static_cast<float>(full_scale)));
}

/// Whether a PNG has 16 bits a channel: byte 24, in its first chunk (PNG specification, 11.2.2).
bool png_has_16_bits(const std::filesystem::path& path) {
  std::array<char, 25> head{};
  std::ifstream file(path, std::ios::binary);
  return file.read(head.data(), head.size()) && head[24] == 16;
}

Result<PictureCounts> read_png_counts(const std::filesystem::path& path, std::uint16_t full_scale) {
  if (!png_has_16_bits(path)) {
    VENEER_ASSIGN(const Image<Rgb8> picture, read_png(path));
    return from_8_bits(picture, full_scale);
  }
  VENEER_ASSIGN(Image<Rgb16> picture, read_png16(path));
  return PictureCounts{std::move(picture), full_scale == 0 ? std::uint16_t{65535} : full_scale};
}

Result<PictureCounts> read_exr_counts(const std::filesystem::path& path, std::uint16_t full_scale) {
  VENEER_ASSIGN(const std::vector<ExrChannel> channels, read_exr(path));
  std::array<const Image<float>*, 3> planes{};
  const auto named = [&](std::string_view name) -> const Image<float>* {
    const auto found = std::ranges::find(channels, name, &ExrChannel::name);
    return found == channels.end() ? nullptr : &found->pixels;
  };
  if (channels.size() == 1) {
    planes.fill(&channels.front().pixels);
  } else if (const Image<float>* grey = named("Y")) {
    planes.fill(grey);
  } else {
    planes = {named("R"), named("G"), named("B")};
  }
  if (std::ranges::find(planes, nullptr) != planes.end()) {
    return fail(Errc::kBadFormat,
                "reading {}: it has neither the channels R, G and B nor Y nor a single one",
                path.string());
  }
  PictureCounts result{Image<Rgb16>(planes[0]->width(), planes[0]->height()),
                       full_scale == 0 ? std::uint16_t{65535} : full_scale};
  for (std::size_t i = 0; i < result.counts.pixels().size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      VENEER_ASSIGN(result.counts.pixels()[i][c],
                    count_of(planes[c]->pixels()[i], result.full_scale, path));
    }
  }
  return result;
}

Result<PictureCounts> read_tiff_counts(const std::filesystem::path& path,
                                       std::uint16_t full_scale) {
  VENEER_ASSIGN(const TiffSamples samples, read_tiff(path));
  PictureCounts result{Image<Rgb16>(samples.width, samples.height), full_scale};
  if (full_scale == 0) result.full_scale = samples.bits == 8 ? 255 : 65535;
  const auto channels = static_cast<std::size_t>(samples.channels);
  for (std::size_t i = 0; i < result.counts.pixels().size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = i * channels + std::min(c, channels - 1);
      std::uint16_t& count = result.counts.pixels()[i][c];
      if (samples.values.empty()) {
        count = samples.counts[at];
      } else {
        VENEER_ASSIGN(count, count_of(samples.values[at], result.full_scale, path));
      }
    }
  }
  return result;
}

}  // namespace

PictureKind kind_of(const std::filesystem::path& path) {
  const std::string ending = ending_of(path);
  const auto found =
      std::ranges::find(kEndings, ending, &std::pair<std::string_view, PictureKind>::first);
  return found == kEndings.end() ? PictureKind::kNone : found->second;
}

std::optional<double> exposure_of(const std::filesystem::path& path) {
  const std::string ending = ending_of(path);
  if (ending != ".tif" && ending != ".tiff") return std::nullopt;
  return tiff_exposure(path);
}

Result<PictureCounts> read_picture(const std::filesystem::path& path, std::uint16_t full_scale) {
  const std::string ending = ending_of(path);
  if (ending == ".png") return read_png_counts(path, full_scale);
  if (ending == ".exr") return read_exr_counts(path, full_scale);
  if (ending == ".tif" || ending == ".tiff") return read_tiff_counts(path, full_scale);
  if (kind_of(path) == PictureKind::kEncoded) {
    VENEER_ASSIGN(const Image<Rgb8> picture, read_jpeg(path));
    return from_8_bits(picture, full_scale);
  }
  return fail(Errc::kBadFormat, "reading {}: it is no PNG, TIFF, EXR or JPEG", path.string());
}

}  // namespace veneer::capture
