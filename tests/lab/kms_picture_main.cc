// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <iostream>
#include <string>

#include "base/exit_code.h"
#include "base/image_files.h"
#include "projector/outputs.h"

// Shows a known picture on a display of the kernel lab and writes what it is to look like, so that
// what is scanned out can be compared, bit for bit.
namespace veneer::lab {
namespace {

/// Every code of every channel, edges of one pixel, and no two rows or columns alike: a row too
/// many, a channel swapped or a table in between changes it.
Image<Rgb8> test_card(int width, int height) {
  Image<Rgb8> card(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const bool edge = x == 0 || y == 0 || x == width - 1 || y == height - 1;
      const auto code = [](int value) { return static_cast<std::uint8_t>(value & 0xFF); };
      card(x, y) =
          edge ? Rgb8{255, code(x), code(y)} : Rgb8{code(x), code(y), code(x * 7 + y * 13)};
    }
  return card;
}

Status show(const std::string& config, int width, int height, const std::string& expected) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(config, "the command line"));
  VENEER_ASSIGN(const auto output, projector::open_output(toml));
  VENEER_TRY(toml.finish());
  // Pixels, not the GPU: what the renderer makes of a display's buffers is another test.
  output->give_up_scanout();
  const Image<Rgb8> card = test_card(width, height);
  VENEER_TRY(write_png(expected, card.view()));
  Image<Rgb16> codes(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (std::size_t channel = 0; channel < 3; ++channel)
        codes(x, y)[channel] = card(x, y)[channel];
  // More frames than there are buffers, so that all of them were written.
  constexpr std::uint64_t kFrames = 5;
  for (std::uint64_t number = 0; number < kFrames; ++number) {
    projector::Frame frame;
    frame.number = number;
    frame.codes = codes.view();
    VENEER_TRY(output->present(frame));
  }
  VENEER_TRY(output->finish());
  const auto seen = output->last_presented();
  if (!seen || seen->number + 1 != kFrames)
    return fail(Errc::kIo, "showing a picture: the last frame was not seen to be presented");
  fmt::print("presented on {}\n", output->description());
  std::fflush(stdout);
  for (std::string line; std::getline(std::cin, line);) {
    if (line != "blank") continue;
    VENEER_TRY(output->blank());
    fmt::print("blank\n");
    std::fflush(stdout);
  }
  return {};
}

}  // namespace
}  // namespace veneer::lab

int main(int argc, char** argv) {
  if (argc != 5) {
    fmt::print(stderr, "usage: veneer_lab_kms_picture OUTPUT-TOML WIDTH HEIGHT EXPECTED.png\n");
    return veneer::kExitUsage;
  }
  const veneer::Status shown =
      veneer::lab::show(argv[1], std::stoi(argv[2]), std::stoi(argv[3]), argv[4]);
  if (shown) return veneer::kExitDone;
  fmt::print(stderr, "{}\n", shown.error().what);
  return veneer::exit_code_of(shown.error());
}
