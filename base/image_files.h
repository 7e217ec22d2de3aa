// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace veneer {

// All writers write whole or not at all (temporary file, then rename) and make missing folders.
// All readers: kNotFound, kIo, kBadFormat (damaged, or more than kMaxImagePixels).

/// Largest picture that is read, in pixels: 16384 x 16384, above any camera's and any texture's
/// that GL takes, yet a decoded 16-bit picture of it (1.5 GiB) fits the memory of a common machine.
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 28;

[[nodiscard]] Status write_png(const std::filesystem::path& path, ImageView<const Rgb8> image);
[[nodiscard]] Status write_png(const std::filesystem::path& path, ImageView<const Rgb16> image);
/// Any PNG as 8-bit RGB: alpha is dropped, grey is spread, 16 bits are cut to 8.
[[nodiscard]] Result<Image<Rgb8>> read_png(const std::filesystem::path& path);
/// Any PNG as 16-bit RGB; 8-bit values are spread over the range (255 -> 65535).
[[nodiscard]] Result<Image<Rgb16>> read_png16(const std::filesystem::path& path);
/// A baseline or progressive JPEG as 8-bit RGB.
[[nodiscard]] Result<Image<Rgb8>> read_jpeg(const std::filesystem::path& path);
/// The same from a file's bytes, which lie in an archive for example.
/// @param name  for messages.
[[nodiscard]] Result<Image<Rgb8>> decode_jpeg(std::string_view bytes,
                                              const std::filesystem::path& name);

/// One named float channel of an OpenEXR image, such as "R" or "specular.R".
struct ExrChannel {
  std::string name;
  Image<float> pixels;
};
/// What is to be known about a picture, as texts in its header. OpenEXR's own names ("channels",
/// "dataWindow", ...) are taken: begin with a word and a dot.
using ExrAttributes = std::map<std::string, std::string>;
/// @param channels  all of one size; names unique. Stored as 32-bit float, ZIP-compressed.
[[nodiscard]] Status write_exr(const std::filesystem::path& path,
                               const std::vector<ExrChannel>& channels,
                               const ExrAttributes& attributes = {});
/// Three channels named `names` (default R, G, B).
[[nodiscard]] Status write_exr(const std::filesystem::path& path,
                               ImageView<const Rgb32f> image,
                               const std::array<std::string, 3>& names = {"R", "G", "B"});
/// All channels of the first part, converted to float.
[[nodiscard]] Result<std::vector<ExrChannel>> read_exr(const std::filesystem::path& path);
struct ExrPicture {
  std::vector<ExrChannel> channels;
  ExrAttributes attributes;  ///< those that are texts
};
/// The same with what its header says.
[[nodiscard]] Result<ExrPicture> read_exr_picture(const std::filesystem::path& path);
/// The three named channels; kBadFormat where one is missing.
[[nodiscard]] Result<Image<Rgb32f>> read_exr_rgb(const std::filesystem::path& path,
                                                 const std::array<std::string, 3>& names = {
                                                     "R", "G", "B"});

}  // namespace veneer
