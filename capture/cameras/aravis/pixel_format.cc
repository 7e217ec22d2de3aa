// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/aravis/pixel_format.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <utility>

namespace veneer::capture {
namespace {

using Colours = PixelFormat::Colours;
using Packing = PixelFormat::Packing;

struct Family {
  std::string_view prefix;
  Colours colours;
  Mosaic mosaic;
};
// The longer of two names that begin alike comes first.
constexpr std::array<Family, 7> kFamilies{{
    {"BayerRGPolarized", Colours::kGrey, Mosaic::kPolarColour},
    {"BayerRG", Colours::kRggb, Mosaic::kNone},
    {"BayerGR", Colours::kGrbg, Mosaic::kNone},
    {"BayerGB", Colours::kGbrg, Mosaic::kNone},
    {"BayerBG", Colours::kBggr, Mosaic::kNone},
    {"Polarized", Colours::kGrey, Mosaic::kPolarMono},
    {"Mono", Colours::kGrey, Mosaic::kNone},
}};

struct Depth {
  std::string_view suffix;
  int bits;
  Packing packing;
};
constexpr std::array<Depth, 10> kDepths{{
    {"8", 8, Packing::kBytes},
    {"10", 10, Packing::kWords},
    {"12", 12, Packing::kWords},
    {"14", 14, Packing::kWords},
    {"16", 16, Packing::kWords},
    {"10p", 10, Packing::kBits},
    {"12p", 12, Packing::kBits},
    {"14p", 14, Packing::kBits},
    {"10Packed", 10, Packing::kPairs},
    {"12Packed", 12, Packing::kPairs},
}};

/// Samples of one row after another, all bits of a row beginning at a byte where rows are padded.
class SampleReader {
 public:
  SampleReader(std::span<const std::byte> bytes, const PixelFormat& format)
      : bytes_(bytes), format_(format) {}

  /// @param row_begin  byte offset.   @param i  of the sample in what begins there.
  [[nodiscard]] std::uint16_t at(std::size_t row_begin, std::size_t i) const {
    const auto byte = [&](std::size_t k) {
      return std::to_integer<std::uint32_t>(bytes_[row_begin + k]);
    };
    const auto bits = static_cast<std::size_t>(format_.bits);
    switch (format_.packing) {
      case Packing::kBytes:
        return static_cast<std::uint16_t>(byte(i));
      case Packing::kWords:
        return static_cast<std::uint16_t>(byte(2 * i) | byte(2 * i + 1) << 8);
      case Packing::kBits: {
        const std::size_t first = i * bits;
        const std::size_t last = (first + bits - 1) / 8;
        std::uint32_t value = 0;
        for (std::size_t k = first / 8; k <= last; ++k) value |= byte(k) << (8 * (k - first / 8));
        return static_cast<std::uint16_t>(value >> (first % 8) & format_.full_scale());
      }
      case Packing::kPairs: {
        const std::size_t pair = i / 2 * 3;
        const std::size_t low_bits = bits - 8;
        const std::uint32_t low = byte(pair + 1) >> (i % 2 == 0 ? 0 : 4);
        return static_cast<std::uint16_t>(byte(pair + (i % 2 == 0 ? 0 : 2)) << low_bits |
                                          (low & ((1U << low_bits) - 1)));
      }
    }
    return 0;
  }

 private:
  std::span<const std::byte> bytes_;
  const PixelFormat& format_;
};

std::size_t bits_per_sample(const PixelFormat& format) {
  switch (format.packing) {
    case Packing::kBytes:
      return 8;
    case Packing::kWords:
      return 16;
    case Packing::kBits:
      return static_cast<std::size_t>(format.bits);
    case Packing::kPairs:
      return 12;
  }
  return 16;
}

int opencv_code(Colours colours) {
  switch (colours) {
    case Colours::kGrbg:
      return cv::COLOR_BayerGRBG2RGB;
    case Colours::kGbrg:
      return cv::COLOR_BayerGBRG2RGB;
    case Colours::kBggr:
      return cv::COLOR_BayerBGGR2RGB;
    default:
      return cv::COLOR_BayerRGGB2RGB;
  }
}

Result<Image<Rgb16>> interpolated(const cv::Mat& raw, Colours colours) {
  Image<Rgb16> counts(raw.cols, raw.rows);
  if (raw.cols < 2 || raw.rows < 2) {
    return fail(Errc::kBadFormat,
                "a picture of {} x {} pixels has no whole cell of the colour pattern; make the "
                "region of the camera larger",
                raw.cols,
                raw.rows);
  }
  cv::Mat result(raw.rows, raw.cols, CV_16UC3, counts.pixels().data());
  try {
    cv::cvtColor(raw, result, opencv_code(colours));
  } catch (const cv::Exception& error) {
    return fail(Errc::kBadFormat, "interpolating the colours: {}", error.what());
  }
  return counts;
}

}  // namespace

std::optional<PixelFormat> pixel_format_named(std::string_view name) {
  if (name == "RGB8") {
    return PixelFormat{
        .bits = 8, .packing = Packing::kBytes, .colours = Colours::kRgb, .mosaic = Mosaic::kNone};
  }
  for (const Family& family : kFamilies) {
    if (!name.starts_with(family.prefix)) continue;
    const auto depth =
        std::ranges::find(kDepths, name.substr(family.prefix.size()), &Depth::suffix);
    if (depth == kDepths.end()) continue;
    return PixelFormat{.bits = depth->bits,
                       .packing = depth->packing,
                       .colours = family.colours,
                       .mosaic = family.mosaic};
  }
  return std::nullopt;
}

Result<Image<Rgb16>> counts_of(std::span<const std::byte> bytes,
                               const PixelFormat& format,
                               int width,
                               int height,
                               int row_padding) {
  const std::size_t channels = format.colours == Colours::kRgb ? 3 : 1;
  const std::size_t row_bits =
      channels * static_cast<std::size_t>(std::max(width, 0)) * bits_per_sample(format);
  const auto rows = static_cast<std::size_t>(std::max(height, 0));
  const auto padding = static_cast<std::size_t>(std::max(row_padding, 0));
  // Rows that end inside a byte follow one another without a gap, unless they are padded.
  const bool gapless = padding == 0;
  const std::size_t row_bytes = (row_bits + 7) / 8 + padding;
  const std::size_t needed = gapless ? (row_bits * rows + 7) / 8 : row_bytes * rows - padding;
  if (row_bits == 0 || rows == 0 || bytes.size() < needed) {
    return fail(Errc::kBadFormat,
                "a picture of {} x {} pixels came with {} bytes, and {} are needed; grab again",
                width,
                height,
                bytes.size(),
                needed);
  }
  const SampleReader samples(bytes, format);
  const std::size_t row_samples = row_bits / bits_per_sample(format);
  const auto sample = [&](int y, std::size_t i) {
    const auto row = static_cast<std::size_t>(y);
    return gapless ? samples.at(0, row * row_samples + i) : samples.at(row * row_bytes, i);
  };
  if (format.colours != Colours::kGrey && format.colours != Colours::kRgb) {
    cv::Mat raw(height, width, CV_16UC1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        raw.at<std::uint16_t>(y, x) = sample(y, static_cast<std::size_t>(x));
      }
    }
    return interpolated(raw, format.colours);
  }
  Image<Rgb16> counts(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t first = channels * static_cast<std::size_t>(x);
      for (std::size_t c = 0; c < 3; ++c) {
        counts(x, y)[c] = sample(y, channels == 3 ? first + c : first);
      }
    }
  }
  return counts;
}

}  // namespace veneer::capture
