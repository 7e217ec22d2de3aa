// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate/display_picker.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "projector/outputs/window/window_output.h"

namespace veneer::cli {
namespace {

/// Digits of 3 x 5 dots, rows from the top, the left dot in the highest of three bits.
constexpr std::array<std::array<std::uint8_t, 5>, 10> kDigits{{{7, 5, 5, 5, 7},
                                                               {2, 6, 2, 2, 7},
                                                               {7, 1, 7, 4, 7},
                                                               {7, 1, 7, 1, 7},
                                                               {5, 5, 7, 1, 1},
                                                               {7, 4, 7, 1, 7},
                                                               {7, 4, 7, 5, 7},
                                                               {7, 1, 1, 1, 1},
                                                               {7, 5, 7, 5, 7},
                                                               {7, 5, 7, 1, 7}}};
constexpr Rgb16 kGrey{40, 40, 40};
constexpr Rgb16 kWhite{255, 255, 255};

}  // namespace

Image<Rgb16> number_picture(int number, int width, int height) {
  VENEER_CHECK(number >= 0 && width >= 16 && height >= 16);
  const std::string digits = std::to_string(number);
  // Each digit is 3 dots wide with a dot between two; a dot's margin all around.
  const int columns = 4 * static_cast<int>(digits.size()) + 1;
  constexpr int kRows = 7;
  const int dot = std::max(1, std::min(width / columns, height / kRows));
  const int left = (width - dot * columns) / 2 + dot;
  const int top = (height - dot * kRows) / 2 + dot;
  Image<Rgb16> picture(width, height, kGrey);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool rim = x == 0 || y == 0 || x == width - 1 || y == height - 1;
      const int column = x >= left ? (x - left) / dot : -1;
      const int row = y >= top ? (y - top) / dot : -1;
      const auto digit = static_cast<std::size_t>(column / 4);
      const bool ink = column >= 0 && row >= 0 && row < 5 && column % 4 < 3 &&
                       digit < digits.size() &&
                       ((kDigits.at(static_cast<std::size_t>(digits[digit] - '0'))
                             .at(static_cast<std::size_t>(row)) >>
                         static_cast<unsigned>(2 - column % 4)) &
                        1U) != 0;
      if (rim || ink) picture(x, y) = kWhite;
    }
  }
  return picture;
}

Result<int> pick_display() {
  VENEER_ASSIGN(const std::vector<projector::Display> displays, projector::list_displays());
  for (const projector::Display& display : displays)
    fmt::print(stderr,
               "  {}: {} ({} x {})\n",
               display.number,
               display.name,
               display.width,
               display.height);
  fmt::print(stderr, "Each display shows its number for a few seconds.\n");
  {
    std::vector<std::unique_ptr<projector::WindowOutput>> windows;
    std::vector<Image<Rgb16>> pictures;
    for (const projector::Display& display : displays) {
      VENEER_ASSIGN(std::unique_ptr<projector::WindowOutput> window,
                    projector::WindowOutput::open(
                        projector::WindowOutputOptions{display.number, /*fullscreen=*/true}));
      windows.push_back(std::move(window));
      pictures.push_back(number_picture(display.number, display.width, display.height));
    }
    // Again and again: a window may appear late, and the system wants to see that it lives.
    constexpr int kPictures = 40;
    constexpr std::chrono::milliseconds kPause{100};
    for (int i = 0; i < kPictures; ++i) {
      for (std::size_t k = 0; k < windows.size(); ++k) {
        projector::Frame frame;
        frame.codes = pictures[k].view();
        VENEER_TRY(windows[k]->present(frame));
      }
      std::this_thread::sleep_for(kPause);
    }
  }
  // The windows are gone: they may have covered the terminal.
  fmt::print(stderr, "Which one is the projector? ");
  std::string line;
  std::getline(std::cin, line);
  for (const projector::Display& display : displays) {
    if (line == std::to_string(display.number)) return display.number;
  }
  return fail(Errc::kCancelled,
              "picking the display: \"{}\" is none of the numbers; name it with [output] display",
              line);
}

}  // namespace veneer::cli
