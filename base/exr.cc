// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <exception>
#include <fstream>

#include "base/files.h"
#include "base/image_files.h"
#include "base/internal_image_size.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

}  // namespace

Status write_exr(const fs::path& path,
                 const std::vector<ExrChannel>& channels,
                 const ExrAttributes& attributes) {
  if (channels.empty() || channels.front().pixels.empty()) {
    return fail(Errc::kInvalidOption, "writing {}: the image is empty", path.string());
  }
  const int width = channels.front().pixels.width();
  const int height = channels.front().pixels.height();
  VENEER_ASSIGN(StagedFile staged, StagedFile::create(path));
  try {
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const auto& [name, text] : attributes)
      header.insert(name, Imf::TypedAttribute<std::string>(text));
    Imf::FrameBuffer frame;
    for (const ExrChannel& channel : channels) {
      VENEER_CHECK(channel.pixels.width() == width && channel.pixels.height() == height);
      header.channels().insert(channel.name, Imf::Channel(Imf::FLOAT));
      frame.insert(channel.name,
                   Imf::Slice(Imf::FLOAT,
                              // OpenEXR has one type for reading and writing; it only reads here.
                              const_cast<char*>(
                                  reinterpret_cast<const char*>(channel.pixels.pixels().data())),
                              sizeof(float),
                              sizeof(float) * static_cast<std::size_t>(width)));
    }
    std::ofstream stream(staged.path(), std::ios::binary);
    {
      Imf::StdOFStream out(stream, staged.path().c_str());
      Imf::OutputFile file(out, header);
      file.setFrameBuffer(frame);
      file.writePixels(height);
    }
    // The table of rows is written by the destructor, which keeps to itself that the disk is full.
    stream.close();
    if (!stream)
      return fail(Errc::kIo, "writing {}: it could not be written to its end", path.string());
  } catch (const std::exception& error) {
    return fail(Errc::kIo, "writing {}: {}", path.string(), error.what());
  }
  return staged.commit();
}

Status write_exr(const fs::path& path,
                 ImageView<const Rgb32f> image,
                 const std::array<std::string, 3>& names) {
  std::vector<ExrChannel> channels;
  for (int c = 0; c < 3; ++c) {
    ExrChannel channel{names[static_cast<std::size_t>(c)],
                       Image<float>(image.width(), image.height())};
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) channel.pixels(x, y) = image(x, y)[c];
    }
    channels.push_back(std::move(channel));
  }
  return write_exr(path, channels);
}

Result<std::vector<ExrChannel>> read_exr(const fs::path& path) {
  VENEER_ASSIGN(ExrPicture picture, read_exr_picture(path));
  return std::move(picture.channels);
}

Result<ExrPicture> read_exr_picture(const fs::path& path) {
  if (std::error_code error; !fs::exists(path, error)) {
    return fail(Errc::kNotFound, "reading {}: there is no such file", path.string());
  }
  try {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    const std::int64_t columns = std::int64_t{window.max.x} - window.min.x + 1;
    const std::int64_t rows = std::int64_t{window.max.y} - window.min.y + 1;
    VENEER_TRY(check_image_size(path, columns, rows));
    const int width = static_cast<int>(columns);
    const int height = static_cast<int>(rows);
    ExrPicture picture;
    for (auto it = file.header().begin(); it != file.header().end(); ++it) {
      if (const auto* text = dynamic_cast<const Imf::TypedAttribute<std::string>*>(&it.attribute()))
        picture.attributes[it.name()] = text->value();
    }
    std::vector<ExrChannel>& channels = picture.channels;
    for (auto it = file.header().channels().begin(); it != file.header().channels().end(); ++it) {
      if (it.channel().xSampling != 1 || it.channel().ySampling != 1) {
        return fail(Errc::kBadFormat,
                    "reading {}: channel {} is subsampled; store it whole",
                    path.string(),
                    it.name());
      }
      channels.push_back({it.name(), Image<float>(width, height)});
    }
    Imf::FrameBuffer frame;
    for (ExrChannel& channel : channels) {
      char* base = reinterpret_cast<char*>(channel.pixels.pixels().data());
      const std::size_t row = sizeof(float) * static_cast<std::size_t>(width);
      frame.insert(channel.name,
                   Imf::Slice(Imf::FLOAT,
                              base - window.min.x * static_cast<std::ptrdiff_t>(sizeof(float)) -
                                  window.min.y * static_cast<std::ptrdiff_t>(row),
                              sizeof(float),
                              row));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.max.y);
    return picture;
  } catch (const std::exception& error) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), error.what());
  }
}

Result<Image<Rgb32f>> read_exr_rgb(const fs::path& path, const std::array<std::string, 3>& names) {
  VENEER_ASSIGN(const std::vector<ExrChannel> channels, read_exr(path));
  Image<Rgb32f> image;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto found = std::ranges::find(channels, names[c], &ExrChannel::name);
    if (found == channels.end()) {
      return fail(Errc::kBadFormat, "reading {}: it has no channel {}", path.string(), names[c]);
    }
    if (c == 0) image = Image<Rgb32f>(found->pixels.width(), found->pixels.height());
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x)
        image(x, y)[static_cast<Eigen::Index>(c)] = found->pixels(x, y);
    }
  }
  return image;
}

}  // namespace veneer
