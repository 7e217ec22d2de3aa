// SPDX-License-Identifier: Apache-2.0
#include "capture/testing/dng.h"

// jpeglib.h uses FILE and size_t without including what declares them.
// clang-format off
#include <cstdio>

#include <jpeglib.h>
// clang-format on

#include <cstdlib>
#include <string_view>
#include <vector>

namespace veneer::capture::testing {
namespace {

enum Type : std::uint16_t { kByte = 1, kAscii = 2, kShort = 3, kLong = 4, kSignedRational = 10 };

struct Tag {
  std::uint16_t number;
  Type type;
  std::uint32_t count;
  std::string value;  // its bytes
};

std::string little(std::uint64_t value, int size) {
  std::string bytes;
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
  return bytes;
}

Tag of_short(std::uint16_t number, std::uint16_t value) {
  return {number, kShort, 1, little(value, 2)};
}
Tag of_long(std::uint16_t number, std::uint32_t value) {
  return {number, kLong, 1, little(value, 4)};
}
Tag of_text(std::uint16_t number, std::string_view text) {
  std::string bytes(text);
  bytes.push_back('\0');
  return {number, kAscii, static_cast<std::uint32_t>(bytes.size()), bytes};
}

}  // namespace

std::string bayer_dng(const Image<std::uint16_t>& mosaic, std::uint16_t white_level) {
  const auto width = static_cast<std::uint32_t>(mosaic.width());
  const auto height = static_cast<std::uint32_t>(mosaic.height());
  std::string identity;
  for (int i = 0; i < 9; ++i) identity += little(i % 4 == 0 ? 1 : 0, 4) + little(1, 4);
  std::vector<Tag> tags{
      of_long(254, 0),      // a whole picture
      of_long(256, width),  // width, height
      of_long(257, height),
      of_short(258, 16),     // bits
      of_short(259, 1),      // not compressed
      of_short(262, 32803),  // a colour filter array
      of_text(271, "Veneer"),
      of_text(272, "Loopback DSLR"),
      of_long(273, 0),   // where the pixels are: known below
      of_short(274, 1),  // not turned
      of_short(277, 1),  // samples a pixel
      of_long(278, height),
      of_long(279, width * height * 2),
      {33421, kShort, 2, little(2, 2) + little(2, 2)},
      {33422, kByte, 4, std::string("\0\1\1\2", 4)},
      {50706, kByte, 4, std::string("\1\4\0\0", 4)},
      of_text(50708, "Veneer Loopback DSLR"),
      of_long(50717, white_level),
      {50721, kSignedRational, 9, identity},
      of_short(50778, 21),  // D65
  };
  const auto after_tags = static_cast<std::uint32_t>(8 + 2 + 12 * tags.size() + 4);
  std::uint32_t pixels_at = after_tags;
  for (const Tag& tag : tags) {
    if (tag.value.size() > 4) pixels_at += static_cast<std::uint32_t>(tag.value.size() + 1) & ~1U;
  }
  std::string file = "II" + little(42, 2) + little(8, 4) + little(tags.size(), 2);
  std::string beyond;
  for (Tag& tag : tags) {
    if (tag.number == 273) tag.value = little(pixels_at, 4);
    file += little(tag.number, 2) + little(tag.type, 2) + little(tag.count, 4);
    if (tag.value.size() > 4) {
      file += little(after_tags + beyond.size(), 4);
      beyond += tag.value;
      if (beyond.size() % 2 == 1) beyond.push_back('\0');
    } else {
      std::string value = tag.value;
      value.resize(4, '\0');
      file += value;
    }
  }
  file += little(0, 4) + beyond;
  for (const std::uint16_t count : mosaic.pixels()) file += little(count, 2);
  return file;
}

std::string grey_jpeg(int width, int height, std::uint8_t code) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): libjpeg's own type
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = static_cast<JDIMENSION>(width);
  info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = 1;
  info.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&info);
  jpeg_start_compress(&info, TRUE);
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width), code);
  JSAMPROW rows[] = {row.data()};
  for (int y = 0; y < height; ++y) jpeg_write_scanlines(&info, rows, 1);
  jpeg_finish_compress(&info);
  std::string file(reinterpret_cast<const char*>(bytes), size);
  jpeg_destroy_compress(&info);
  std::free(bytes);
  return file;
}

}  // namespace veneer::capture::testing
