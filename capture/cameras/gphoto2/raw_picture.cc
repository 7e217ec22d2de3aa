// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/raw_picture.h"

#include <libraw/libraw.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/image_files.h"

namespace veneer::capture {
namespace {

/// One sample a pixel, with the colour that it has: 0, 1, 2 for R, G, B.
struct ColourMosaic {
  int width = 0, height = 0;
  const std::uint16_t* first = nullptr;  // the top left pixel
  std::size_t pitch = 0;                 // pixels from row to row
  // The pattern repeats at most every 16 pixels (LibRaw's filters; X-Trans every 6).
  static constexpr int kPeriod = 48;
  std::array<std::array<std::uint8_t, kPeriod>, kPeriod> colour{};  // [row][column]
  [[nodiscard]] std::uint16_t count(int x, int y) const {
    return first[static_cast<std::size_t>(y) * pitch + static_cast<std::size_t>(x)];
  }
  [[nodiscard]] int colour_at(int x, int y) const {
    return colour[static_cast<std::size_t>(y % kPeriod)][static_cast<std::size_t>(x % kPeriod)];
  }
};

/// Mean of the pixels of a colour around one, weights 1 2 1 along either axis in a 3 x 3 window:
/// for a Bayer pattern that is bilinear. In wider windows, which only other patterns need, all
/// weigh the same.
std::uint16_t mean_around(const ColourMosaic& mosaic, int x, int y, int colour, int full_scale) {
  for (int reach = 1; reach <= 3; ++reach) {
    int sum = 0;
    int weights = 0;
    for (int v = std::max(0, y - reach); v <= std::min(mosaic.height - 1, y + reach); ++v) {
      for (int u = std::max(0, x - reach); u <= std::min(mosaic.width - 1, x + reach); ++u) {
        if (mosaic.colour_at(u, v) != colour) continue;
        const int count = mosaic.count(u, v);
        if (count >= full_scale) return static_cast<std::uint16_t>(full_scale);
        const int weight = reach == 1 ? (u == x ? 2 : 1) * (v == y ? 2 : 1) : 1;
        sum += weight * count;
        weights += weight;
      }
    }
    if (weights > 0) return static_cast<std::uint16_t>((sum + weights / 2) / weights);
  }
  return 0;  // a pattern without that colour: there is none
}

Image<Rgb16> interpolate(const ColourMosaic& mosaic, int full_scale) {
  Image<Rgb16> counts(mosaic.width, mosaic.height);
  for (int y = 0; y < mosaic.height; ++y) {
    for (int x = 0; x < mosaic.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        counts(x, y)[static_cast<std::size_t>(c)] = mosaic.colour_at(x, y) == c
                                                        ? mosaic.count(x, y)
                                                        : mean_around(mosaic, x, y, c, full_scale);
      }
    }
  }
  return counts;
}

}  // namespace

Result<RawPicture> decode_raw(const std::string& bytes, const std::string& name) {
  // Its object is larger than a stack should hold.
  const auto raw = std::make_unique<LibRaw>();
  // Damage is noted, not printed on the terminal.
  bool damaged = false;
  raw->set_dataerror_handler(
      [](void* noted, const char*, auto) { *static_cast<bool*>(noted) = true; }, &damaged);
  std::string buffer = bytes;  // LibRaw wants to write to it
  if (const int error = raw->open_buffer(buffer.data(), buffer.size()); error != LIBRAW_SUCCESS) {
    return fail(Errc::kBadFormat,
                "decoding {} ({} bytes): {}; is it a RAW file, and of a camera that LibRaw {} "
                "knows?",
                name,
                bytes.size(),
                libraw_strerror(error),
                LibRaw::version());
  }
  const libraw_data_t& data = raw->imgdata;
  const libraw_image_sizes_t& sizes = data.sizes;
  if (std::int64_t{sizes.raw_width} * sizes.raw_height > kMaxImagePixels) {
    return fail(Errc::kBadFormat,
                "decoding {}: {} x {} pixels is no camera's size",
                name,
                sizes.raw_width,
                sizes.raw_height);
  }
  const int error = raw->unpack();
  if (error != LIBRAW_SUCCESS || damaged) {
    return fail(Errc::kBadFormat,
                "decoding {} ({} bytes): {}; the file is damaged or cut: take the picture again, "
                "and change cable or card if that goes on",
                name,
                bytes.size(),
                error != LIBRAW_SUCCESS ? libraw_strerror(error) : "damaged data");
  }
  const int width = sizes.width;
  const int height = sizes.height;
  const int left = sizes.left_margin;
  const int top = sizes.top_margin;
  if (width < 2 || height < 2 || left + width > sizes.raw_width ||
      top + height > sizes.raw_height) {
    return fail(Errc::kBadFormat, "decoding {}: its sizes contradict each other", name);
  }

  // What the maker says where it does, else LibRaw's table; the lowest, so that nothing that is
  // saturated in one channel passes for light.
  std::int64_t full_scale = data.color.maximum;
  for (const long most : data.color.linear_max) {
    if (most > 0) full_scale = std::min<std::int64_t>(full_scale, most);
  }
  if (full_scale <= 0 || full_scale > 65535) full_scale = 65535;
  RawPicture picture;
  picture.full_scale = static_cast<std::uint16_t>(full_scale);

  const auto& rawdata = data.rawdata;
  if (rawdata.raw_image != nullptr) {
    ColourMosaic mosaic;
    mosaic.width = width;
    mosaic.height = height;
    mosaic.pitch = sizes.raw_pitch / sizeof(std::uint16_t);
    mosaic.first = rawdata.raw_image + static_cast<std::size_t>(top) * mosaic.pitch +
                   static_cast<std::size_t>(left);
    if (data.idata.colors == 1) {
      picture.counts = Image<Rgb16>(width, height);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) picture.counts(x, y).fill(mosaic.count(x, y));
      }
      return picture;
    }
    if (data.idata.colors == 3 && data.idata.filters != 0) {
      for (int y = 0; y < ColourMosaic::kPeriod; ++y) {
        for (int x = 0; x < ColourMosaic::kPeriod; ++x) {
          const int colour = raw->COLOR(y, x);  // 3 is the second green
          mosaic.colour[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] =
              static_cast<std::uint8_t>(colour == 3 ? 1 : colour);
        }
      }
      picture.counts = interpolate(mosaic, picture.full_scale);
      return picture;
    }
  } else if (rawdata.color3_image != nullptr || rawdata.color4_image != nullptr) {
    const std::size_t channels = rawdata.color3_image != nullptr ? 3 : 4;
    const std::uint16_t* samples =
        rawdata.color3_image != nullptr ? rawdata.color3_image[0] : rawdata.color4_image[0];
    const std::size_t pitch = sizes.raw_pitch / sizeof(std::uint16_t);
    picture.counts = Image<Rgb16>(width, height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::uint16_t* pixel = samples + static_cast<std::size_t>(top + y) * pitch +
                                     static_cast<std::size_t>(left + x) * channels;
        picture.counts(x, y) = {pixel[0], pixel[1], pixel[2]};
      }
    }
    return picture;
  }
  return fail(Errc::kBadFormat,
              "decoding {}: a sensor of {} colours in a pattern that Veneer has no use for (known: "
              "Bayer, X-Trans, monochrome, three samples a pixel)",
              name,
              data.idata.colors);
}

}  // namespace veneer::capture
