// SPDX-License-Identifier: Apache-2.0
// In an emulated machine with a virtual graphics card: shows a known picture through the real
// output, so that what is scanned out can be compared with what was sent.
//
//   veneer_kms_lab_test [--seconds S] [--png FILE] [--frames N] [--draw WxH] [KEY=VALUE...]
//
// shows N frames of which the last one is the known picture, holds it for S seconds and writes it
// to FILE; with --draw 1024x768 it writes that picture of 8 bits alone and opens nothing. KEY=VALUE
// are keys of [output] in TOML's syntax (mode="1024x768"). "presented" is printed once the picture
// is on the screen. Exit status 0, or 1 with what went wrong.
#include <unistd.h>

#include <charconv>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>

#include "base/image_files.h"
#include "base/toml_reader.h"
#include "projector/outputs.h"
#include "projector/outputs/kms/displays.h"
#include "projector/outputs/kms/kms_output.h"

namespace veneer::projector {
namespace {

/// Red grows to the right, green downwards, blue along both; a white mark in the upper left corner,
/// red, green and blue ones in the others clockwise, so that no flip or swap goes unseen.
Image<Rgb16> known_picture(int width, int height, int bits) {
  const int full = (1 << bits) - 1;
  const auto code = [full](int i, int size) {
    return static_cast<std::uint16_t>(size < 2 ? 0 : i * full / (size - 1));
  };
  Image<Rgb16> picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      picture(x, y) = {code(x, width), code(y, height), static_cast<std::uint16_t>((x + y) & full)};
  }
  constexpr int kMark = 16;
  const auto white = static_cast<std::uint16_t>(full);
  for (int y = 0; y < kMark && y < height; ++y) {
    for (int x = 0; x < kMark && x < width; ++x) {
      picture(x, y) = {white, white, white};
      picture(width - 1 - x, y) = {white, 0, 0};
      picture(width - 1 - x, height - 1 - y) = {0, white, 0};
      picture(x, height - 1 - y) = {0, 0, white};
    }
  }
  return picture;
}

/// As PNG of 8 or 16 bits, code for code.
Status write(const Image<Rgb16>& picture, int bits, const std::string& path) {
  if (path.empty()) return {};
  if (bits > 8) return write_png(path, picture.view());
  Image<Rgb8> eight(picture.width(), picture.height());
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      eight.pixels()[i][c] = static_cast<std::uint8_t>(picture.pixels()[i][c]);
  }
  return write_png(path, eight.view());
}

struct Arguments {
  int seconds = 5;
  int frames = 60;
  int draw_width = 0;  // 0: show it
  int draw_height = 0;
  std::string png;
  std::string keys;
};

Result<Arguments> parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument.find('=') != std::string_view::npos) {
      arguments.keys += fmt::format("{}\n", argument);
      continue;
    }
    if (i + 1 == argc) return fail(Errc::kInvalidOption, "{} needs a value", argument);
    const std::string_view value = argv[++i];
    const auto number = [value](int& into) {
      const auto parsed = std::from_chars(value.data(), value.data() + value.size(), into);
      return parsed.ec == std::errc{} && parsed.ptr == value.data() + value.size() && into > 0;
    };
    const auto size = [value, &arguments] {
      const char* end = value.data() + value.size();
      const auto width = std::from_chars(value.data(), end, arguments.draw_width);
      if (width.ec != std::errc{} || width.ptr == end || *width.ptr != 'x') return false;
      const auto height = std::from_chars(width.ptr + 1, end, arguments.draw_height);
      return height.ec == std::errc{} && height.ptr == end && arguments.draw_width > 0 &&
             arguments.draw_height > 0;
    };
    if (argument == "--png") {
      arguments.png = value;
    } else if (!(argument == "--seconds" && number(arguments.seconds)) &&
               !(argument == "--frames" && number(arguments.frames)) &&
               !(argument == "--draw" && size())) {
      return fail(Errc::kInvalidOption, "{} {} is not understood", argument, value);
    }
  }
  return arguments;
}

Status show(const Arguments& arguments) {
  if (arguments.draw_width > 0)
    return write(known_picture(arguments.draw_width, arguments.draw_height, 8), 8, arguments.png);
  VENEER_ASSIGN(const std::vector<KmsDisplay> displays, kms_displays());
  for (const KmsDisplay& each : displays)
    fmt::print("{} {} ({}): {}{}, \"{}\", {} modes\n",
               each.device,
               each.connector,
               each.driver,
               each.connected ? "connected" : "nothing connected",
               each.in_use ? ", in use" : "",
               each.name,
               each.modes.size());
  VENEER_ASSIGN(TomlReader toml,
                TomlReader::parse("driver = \"kms\"\n" + arguments.keys, "the arguments"));
  VENEER_ASSIGN(const std::unique_ptr<Output> output, open_output(toml));
  VENEER_TRY(toml.finish());
  fmt::print("{}\n", output->description());
  const auto* kms = dynamic_cast<const KmsOutput*>(output.get());
  if (kms == nullptr) return fail(Errc::kInvalidOption, "driver must be \"kms\"");
  const KmsMode& mode = kms->display().mode;
  // Copied pixels are what can be made here without a renderer.
  output->give_up_scanout();
  const Image<Rgb16> picture = known_picture(mode.width, mode.height, kms->bits());
  const Image<Rgb16> other(mode.width, mode.height, Rgb16{3, 2, 1});
  SteadyClock clock;
  const Time begin = clock.now();
  for (int i = 0; i < arguments.frames; ++i) {
    Frame frame;
    frame.number = static_cast<std::uint64_t>(i);
    frame.bits = kms->bits();
    frame.codes = (i + 1 == arguments.frames ? picture : other).view();
    VENEER_TRY(output->present(frame));
    if (i == arguments.frames / 2) VENEER_TRY(output->blank());
  }
  VENEER_TRY(output->finish());
  const std::optional<Presented> seen = output->last_presented();
  if (!seen || seen->number + 1 != static_cast<std::uint64_t>(arguments.frames))
    return fail(Errc::kTimeout, "the last frame was handed over and never seen");
  if (seen->time < begin || seen->time > clock.now())
    return fail(Errc::kBadFormat, "the last frame was seen at a time that was not");
  VENEER_TRY(write(picture, kms->bits(), arguments.png));
  fmt::print("presented {} x {}, {} frames in {:.2f} s, {} waits\n",
             mode.width,
             mode.height,
             arguments.frames,
             to_seconds(clock.now() - begin),
             output->waits());
  std::fflush(stdout);
  ::sleep(static_cast<unsigned>(arguments.seconds));
  return {};
}

}  // namespace
}  // namespace veneer::projector

int main(int argc, char** argv) {
  using namespace veneer;
  const Result<projector::Arguments> arguments = projector::parse(argc, argv);
  const Status shown =
      arguments ? projector::show(*arguments) : Status(tl::unexpected<Error>(arguments.error()));
  if (shown) return 0;
  fmt::print(stderr, "veneer_kms_lab_test: {}\n", shown.error().what);
  return 1;
}
