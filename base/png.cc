// SPDX-License-Identifier: Apache-2.0
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdio>
#include <memory>

#include "base/files.h"
#include "base/image_files.h"
#include "base/internal_image_size.h"

namespace veneer {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

static_assert(std::endian::native == std::endian::little, "16-bit PNG rows are swapped below");

void remember_error(png_structp png, png_const_charp message) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = message;
  png_longjmp(png, 1);
}
void ignore_warning(png_structp, png_const_charp) {}

// libpng reports errors by longjmp, so the functions that call it hold no C++ objects.
bool write_rows(std::FILE* file,
                const std::byte* first_row,
                std::ptrdiff_t row_bytes,
                int width,
                int height,
                int depth,
                std::string* error) {
  png_structp png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, error, remember_error, ignore_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  png_set_compression_level(png, 3);  // frames are many; the files grow by a few per cent
  png_set_IHDR(png,
               info,
               static_cast<png_uint_32>(width),
               static_cast<png_uint_32>(height),
               depth,
               PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (depth == 16) png_set_swap(png);
  for (int y = 0; y < height; ++y) {
    png_write_row(png, reinterpret_cast<png_const_bytep>(first_row + y * row_bytes));
  }
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return true;
}

template <class Pixel>
Status write_image(const std::filesystem::path& path, ImageView<const Pixel> image, int depth) {
  if (image.empty())
    return fail(Errc::kInvalidOption, "writing {}: the image is empty", path.string());
  VENEER_ASSIGN(StagedFile staged, StagedFile::create(path));
  std::string error = "out of memory";
  {
    const File file(std::fopen(staged.path().c_str(), "wb"));
    if (!file) return fail(Errc::kIo, "writing {}: cannot open it", path.string());
    const auto row_bytes = image.stride() * static_cast<std::ptrdiff_t>(sizeof(Pixel));
    if (!write_rows(file.get(),
                    reinterpret_cast<const std::byte*>(image.data()),
                    row_bytes,
                    image.width(),
                    image.height(),
                    depth,
                    &error)) {
      return fail(Errc::kIo, "writing {}: {}", path.string(), error);
    }
    if (std::fflush(file.get()) != 0)
      return fail(Errc::kIo, "writing {}: the disk may be full", path.string());
  }
  return staged.commit();
}

struct Reader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
};

bool read_header(Reader& reader, std::FILE* file, int depth, std::string* error) {
  reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, error, remember_error, ignore_warning);
  if (reader.png == nullptr) return false;
  reader.info = png_create_info_struct(reader.png);
  if (reader.info == nullptr || setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_init_io(reader.png, file);
  png_read_info(reader.png, reader.info);
  png_set_expand(reader.png);
  png_set_gray_to_rgb(reader.png);
  png_set_strip_alpha(reader.png);
  if (depth == 16) {
    png_set_expand_16(reader.png);
    png_set_swap(reader.png);
  } else {
    png_set_scale_16(reader.png);
  }
  png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  return true;
}

bool read_rows(Reader& reader, png_bytepp rows) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_read_image(reader.png, rows);
  return true;
}

template <class Pixel>
Result<Image<Pixel>> read_image(const std::filesystem::path& path, int depth) {
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file)
    return fail(
        Errc::kNotFound, "reading {}: there is no such file, or it may not be read", path.string());
  std::string error = "out of memory";
  Reader reader;
  if (!read_header(reader, file.get(), depth, &error)) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), error);
  }
  const auto width = static_cast<int>(png_get_image_width(reader.png, reader.info));
  const auto height = static_cast<int>(png_get_image_height(reader.png, reader.info));
  VENEER_TRY(check_image_size(path, width, height));
  VENEER_CHECK(png_get_rowbytes(reader.png, reader.info) ==
               sizeof(Pixel) * static_cast<std::size_t>(width));
  Image<Pixel> image(width, height);
  std::vector<png_bytep> rows;
  rows.reserve(static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) rows.push_back(reinterpret_cast<png_bytep>(&image(0, y)));
  if (!read_rows(reader, rows.data())) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), error);
  }
  return image;
}

}  // namespace

Status write_png(const std::filesystem::path& path, ImageView<const Rgb8> image) {
  return write_image(path, image, 8);
}
Status write_png(const std::filesystem::path& path, ImageView<const Rgb16> image) {
  return write_image(path, image, 16);
}
Result<Image<Rgb8>> read_png(const std::filesystem::path& path) {
  return read_image<Rgb8>(path, 8);
}
Result<Image<Rgb16>> read_png16(const std::filesystem::path& path) {
  return read_image<Rgb16>(path, 16);
}

}  // namespace veneer
