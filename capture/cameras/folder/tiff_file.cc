// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/folder/tiff_file.h"

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

#include "base/image_files.h"

namespace veneer::capture {
namespace {

struct CloseTiff {
  void operator()(TIFF* file) const { TIFFClose(file); }
};
using Tiff = std::unique_ptr<TIFF, CloseTiff>;

int remember_error(
    TIFF* /*file*/, void* text, const char* /*module*/, const char* format, va_list arguments) {
  std::array<char, 256> line{};
  std::vsnprintf(line.data(), line.size(), format, arguments);
  *static_cast<std::string*>(text) = line.data();
  return 1;
}
int ignore_warning(TIFF* /*file*/, void*, const char*, const char*, va_list) { return 1; }

/// @param why  borrowed as long as the file is open.
Tiff open_tiff(const std::filesystem::path& path, std::string& why) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  if (options == nullptr) return nullptr;
  TIFFOpenOptionsSetErrorHandlerExtR(options, &remember_error, &why);
  TIFFOpenOptionsSetWarningHandlerExtR(options, &ignore_warning, nullptr);
  Tiff file(TIFFOpenExt(path.c_str(), "r", options));
  TIFFOpenOptionsFree(options);
  return file;
}

struct Layout {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, channels = 1, planar = 1, format = 1, colours = 0;
};

Layout layout_of(TIFF* file) {
  Layout layout;
  TIFFGetField(file, TIFFTAG_IMAGEWIDTH, &layout.width);
  TIFFGetField(file, TIFFTAG_IMAGELENGTH, &layout.height);
  TIFFGetFieldDefaulted(file, TIFFTAG_BITSPERSAMPLE, &layout.bits);
  TIFFGetFieldDefaulted(file, TIFFTAG_SAMPLESPERPIXEL, &layout.channels);
  TIFFGetFieldDefaulted(file, TIFFTAG_PLANARCONFIG, &layout.planar);
  TIFFGetFieldDefaulted(file, TIFFTAG_SAMPLEFORMAT, &layout.format);
  TIFFGetField(file, TIFFTAG_PHOTOMETRIC, &layout.colours);
  return layout;
}

bool can_be_read(TIFF* file, const Layout& l) {
  const bool counts = (l.bits == 8 || l.bits == 16) && l.format == SAMPLEFORMAT_UINT;
  const bool floats = l.bits == 32 && l.format == SAMPLEFORMAT_IEEEFP;
  const bool grey = l.colours == PHOTOMETRIC_MINISBLACK && l.channels <= 2;
  const bool rgb = l.colours == PHOTOMETRIC_RGB && (l.channels == 3 || l.channels == 4);
  return (counts || floats) && (grey || rgb) && l.planar == PLANARCONFIG_CONTIG &&
         TIFFIsTiled(file) == 0;
}

template <class Sample, class To>
void append(const std::vector<std::byte>& line,
            const Layout& l,
            int channels,
            std::vector<To>& to) {
  for (std::size_t x = 0; x < l.width; ++x) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
      Sample sample{};
      std::memcpy(&sample, line.data() + (x * l.channels + c) * sizeof(Sample), sizeof(Sample));
      to.push_back(static_cast<To>(sample));
    }
  }
}

}  // namespace

Result<TiffSamples> read_tiff(const std::filesystem::path& path) {
  std::string why = "it is no TIFF";
  const Tiff file = open_tiff(path, why);
  if (file == nullptr) return fail(Errc::kBadFormat, "reading {}: {}", path.string(), why);
  const Layout layout = layout_of(file.get());
  if (!can_be_read(file.get(), layout)) {
    return fail(
        Errc::kBadFormat,
        "reading {}: it has {} channels of {} bits, and can be read as grey or RGB of 8 or 16 "
        "bits or 32-bit floats, in strips, not planar, without a palette; convert it to that",
        path.string(),
        layout.channels,
        layout.bits);
  }
  const std::uint64_t pixels = std::uint64_t{layout.width} * layout.height;
  if (pixels == 0 || pixels > static_cast<std::uint64_t>(kMaxImagePixels)) {
    return fail(Errc::kBadFormat,
                "reading {}: it says that it has {} x {} pixels",
                path.string(),
                layout.width,
                layout.height);
  }
  TiffSamples samples;
  samples.width = static_cast<int>(layout.width);
  samples.height = static_cast<int>(layout.height);
  samples.channels = layout.channels < 3 ? 1 : 3;
  samples.bits = layout.bits;
  const std::size_t row_bytes = std::size_t{layout.width} * layout.channels * layout.bits / 8;
  std::vector<std::byte> line(
      std::max(row_bytes, static_cast<std::size_t>(TIFFScanlineSize64(file.get()))));
  // Row by row, so that a file that lies about its size asks for no more memory than it fills.
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    if (TIFFReadScanline(file.get(), line.data(), y, 0) != 1) {
      return fail(
          Errc::kBadFormat, "reading {}: row {}: {}; convert it again", path.string(), y + 1, why);
    }
    if (layout.bits == 8) append<std::uint8_t>(line, layout, samples.channels, samples.counts);
    if (layout.bits == 16) append<std::uint16_t>(line, layout, samples.channels, samples.counts);
    if (layout.bits == 32) append<float>(line, layout, samples.channels, samples.values);
  }
  return samples;
}

std::optional<double> tiff_exposure(const std::filesystem::path& path) {
  std::string why;
  const Tiff file = open_tiff(path, why);
  if (file == nullptr) return std::nullopt;
  toff_t exif = 0;
  if (TIFFGetField(file.get(), TIFFTAG_EXIFIFD, &exif) != 1 ||
      TIFFReadEXIFDirectory(file.get(), exif) != 1) {
    return std::nullopt;
  }
  // What type libtiff hands out has changed between its versions.
  const TIFFField* field = TIFFFindField(file.get(), EXIFTAG_EXPOSURETIME, TIFF_ANY);
  if (field == nullptr) return std::nullopt;
  double seconds = 0;
  if (TIFFFieldSetGetSize(field) == sizeof(double)) {
    if (TIFFGetField(file.get(), EXIFTAG_EXPOSURETIME, &seconds) != 1) return std::nullopt;
  } else {
    float value = 0;
    if (TIFFGetField(file.get(), EXIFTAG_EXPOSURETIME, &value) != 1) return std::nullopt;
    seconds = value;
  }
  if (!std::isfinite(seconds) || seconds <= 0) return std::nullopt;
  return seconds;
}

}  // namespace veneer::capture
