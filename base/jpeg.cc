// SPDX-License-Identifier: Apache-2.0

// jpeglib.h uses FILE and size_t without including what declares them.
// clang-format off
#include <cstdio>

#include <jpeglib.h>
// clang-format on

#include <csetjmp>
#include <memory>

#include "base/image_files.h"
#include "base/internal_image_size.h"

namespace veneer {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

struct ErrorHandler {
  jpeg_error_mgr base;  // first, so that libjpeg's pointer to it points here
  std::jmp_buf escape;
  char message[JMSG_LENGTH_MAX];
};

void escape_with_message(j_common_ptr info) {
  auto* handler = reinterpret_cast<ErrorHandler*>(info->err);
  info->err->format_message(info, handler->message);
  std::longjmp(handler->escape, 1);
}

struct Decoder {
  ErrorHandler handler{};
  jpeg_decompress_struct info{};
  Decoder() {
    info.err = jpeg_std_error(&handler.base);
    handler.base.error_exit = escape_with_message;
    handler.base.output_message = [](j_common_ptr) {};
    jpeg_create_decompress(&info);
  }
  ~Decoder() { jpeg_destroy_decompress(&info); }
};

// libjpeg reports errors by longjmp, so these hold no C++ objects.
bool read_header(Decoder& decoder, std::FILE* file) {
  if (setjmp(decoder.handler.escape) != 0) return false;
  jpeg_stdio_src(&decoder.info, file);
  jpeg_read_header(&decoder.info, TRUE);
  return true;
}

bool read_header(Decoder& decoder, const char* data, std::size_t size) {
  if (setjmp(decoder.handler.escape) != 0) return false;
  jpeg_mem_src(&decoder.info, reinterpret_cast<const unsigned char*>(data), size);
  jpeg_read_header(&decoder.info, TRUE);
  return true;
}

bool begin(Decoder& decoder) {
  if (setjmp(decoder.handler.escape) != 0) return false;
  decoder.info.out_color_space = JCS_RGB;
  jpeg_start_decompress(&decoder.info);
  return true;
}

bool read_rows(Decoder& decoder, ImageView<Rgb8> image) {
  if (setjmp(decoder.handler.escape) != 0) return false;
  while (decoder.info.output_scanline < decoder.info.output_height) {
    auto* row =
        reinterpret_cast<JSAMPROW>(&image(0, static_cast<int>(decoder.info.output_scanline)));
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_finish_decompress(&decoder.info);
  return true;
}

// What follows the header.
Result<Image<Rgb8>> read_rest(Decoder& decoder, const std::filesystem::path& path) {
  // Before begin(): of a progressive picture it allocates all coefficients.
  VENEER_TRY(check_image_size(path, decoder.info.image_width, decoder.info.image_height));
  if (!begin(decoder)) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), decoder.handler.message);
  }
  Image<Rgb8> image(static_cast<int>(decoder.info.output_width),
                    static_cast<int>(decoder.info.output_height));
  if (!read_rows(decoder, image.view())) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), decoder.handler.message);
  }
  // A file that was cut short decodes with a warning and grey rows.
  if (decoder.handler.base.num_warnings > 0) {
    return fail(
        Errc::kBadFormat, "reading {}: the file is damaged or was cut short", path.string());
  }
  return image;
}

}  // namespace

Result<Image<Rgb8>> read_jpeg(const std::filesystem::path& path) {
  const std::unique_ptr<std::FILE, CloseFile> file(std::fopen(path.c_str(), "rb"));
  if (!file)
    return fail(
        Errc::kNotFound, "reading {}: there is no such file, or it may not be read", path.string());
  Decoder decoder;
  if (!read_header(decoder, file.get())) {
    return fail(Errc::kBadFormat, "reading {}: {}", path.string(), decoder.handler.message);
  }
  return read_rest(decoder, path);
}

Result<Image<Rgb8>> decode_jpeg(std::string_view bytes, const std::filesystem::path& name) {
  Decoder decoder;
  if (!read_header(decoder, bytes.data(), bytes.size())) {
    return fail(Errc::kBadFormat, "reading {}: {}", name.string(), decoder.handler.message);
  }
  return read_rest(decoder, name);
}

}  // namespace veneer
