// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/colour_patches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string_view>

namespace veneer::calibration {
namespace {

// Codes for steps of lightness, as ramp_codes() has them.
constexpr double kCodeExponent = 3.0 / 2.2;

// The levels of the ramp that are nearest to `count` equal steps of lightness, full drive last.
std::vector<std::uint16_t> some_levels(const std::vector<std::uint16_t>& ramp, int count) {
  std::vector<std::uint16_t> levels;
  const auto last = static_cast<double>(ramp.size());
  for (int i = 1; i <= count; ++i)
    levels.push_back(ramp[static_cast<std::size_t>(std::lround(last * i / count)) - 1]);
  return levels;
}

// Radical inverse of `index` in a prime base: fills [0, 1) evenly, whatever the count.
// Source: Halton 1960, "On the Efficiency of Certain Quasi-Random Sequences of Points".
double radical_inverse(int index, int base) {
  double result = 0.0;
  double digit = 1.0 / base;
  for (; index > 0; index /= base, digit /= base) result += digit * (index % base);
  return result;
}

}  // namespace

std::vector<std::uint16_t> ramp_codes(int bits, int levels) {
  // Equal steps of L* are roughly equal steps of the cube root of the light.
  constexpr double kSpacing = 3.0 / 2.2;
  const int full = (1 << bits) - 1;
  std::vector<std::uint16_t> codes;
  int previous = 0;
  for (int i = 1; i <= levels; ++i) {
    const int wanted =
        static_cast<int>(std::lround(full * std::pow(static_cast<double>(i) / levels, kSpacing)));
    // Rounding may make codes equal in the dark; the rest of the ramp must still fit above.
    previous = std::clamp(wanted, previous + 1, full - (levels - i));
    codes.push_back(static_cast<std::uint16_t>(previous));
  }
  return codes;
}

Status ColourPatchOptions::check() const {
  const auto in_range = [](std::string_view name, int value, int low, int high) -> Status {
    if (value >= low && value <= high) return {};
    return fail(Errc::kInvalidOption,
                "colour patches: {} is {}; it must be between {} and {}",
                name,
                value,
                low,
                high);
  };
  VENEER_TRY(in_range("bits", bits, 4, 16));
  VENEER_TRY(in_range("ramp_levels", ramp_levels, 4, std::min(40, (1 << bits) - 1)));
  VENEER_TRY(in_range("black_repeats", black_repeats, 1, 100));
  VENEER_TRY(in_range("grey_levels", grey_levels, 0, ramp_levels));
  if (cube != 0) VENEER_TRY(in_range("cube (0 for none)", cube, 2, std::min(9, ramp_levels + 1)));
  return in_range("additivity_repeats", additivity_repeats, 1, 100);
}

std::vector<Rgb16> ramp_patches(const ColourPatchOptions& options) {
  std::vector<Rgb16> patches;
  for (std::size_t c = 0; c < 3; ++c) {
    for (const std::uint16_t code : ramp_codes(options.bits, options.ramp_levels)) {
      patches.push_back({});
      patches.back()[c] = code;
    }
  }
  // Black between the others, so that a drift of the lamp is averaged out of it.
  for (int i = 0; i < options.black_repeats; ++i)
    patches.insert(patches.begin() +
                       static_cast<std::ptrdiff_t>(patches.size() * static_cast<std::size_t>(i) /
                                                   static_cast<std::size_t>(options.black_repeats)),
                   Rgb16{});
  return patches;
}

std::vector<Rgb16> interaction_patches(const ColourPatchOptions& options) {
  const std::vector<std::uint16_t> ramp = ramp_codes(options.bits, options.ramp_levels);
  std::set<Rgb16> patches;
  for (const std::uint16_t code : some_levels(ramp, options.grey_levels))
    patches.insert({code, code, code});
  if (options.cube > 0) {
    std::vector<std::uint16_t> nodes = some_levels(ramp, options.cube - 1);
    nodes.insert(nodes.begin(), 0);
    for (const std::uint16_t r : nodes) {
      for (const std::uint16_t g : nodes) {
        for (const std::uint16_t b : nodes) {
          if ((r > 0) + (g > 0) + (b > 0) >= 2) patches.insert({r, g, b});
        }
      }
    }
  }
  return {patches.begin(), patches.end()};
}

std::vector<Rgb16> additivity_patches(const ColourPatchOptions& options) {
  const int full = (1 << options.bits) - 1;
  // Half of the light, on a display of exponent 2.2.
  const auto half = static_cast<std::uint16_t>(std::lround(full * std::pow(0.5, 1.0 / 2.2)));
  std::vector<Rgb16> patches;
  for (int repeat = 0; repeat < options.additivity_repeats; ++repeat) {
    for (const std::uint16_t code : {static_cast<std::uint16_t>(full), half}) {
      for (unsigned channels = 1; channels < 8; ++channels) {
        Rgb16 patch{};
        for (unsigned c = 0; c < 3; ++c) patch[c] = (channels >> c & 1U) != 0 ? code : 0;
        patches.push_back(patch);
      }
    }
  }
  return patches;
}

std::vector<Rgb16> verification_patches(int bits, int count, std::span<const Rgb16> fitted) {
  VENEER_CHECK(bits >= 4 && bits <= 16 && count >= 1 && count <= 1000);
  const int full = (1 << bits) - 1;
  std::set<Rgb16> taken(fitted.begin(), fitted.end());
  std::vector<Rgb16> patches;
  constexpr std::array kBases{2, 3, 5};
  constexpr int kMostTried = 1 << 20;  // so that it ends whatever is taken
  for (int i = 1; static_cast<int>(patches.size()) < count && i < kMostTried; ++i) {
    Rgb16 patch{};
    for (std::size_t c = 0; c < 3; ++c)
      patch[c] = static_cast<std::uint16_t>(
          std::lround(full * std::pow(radical_inverse(i, kBases[c]), kCodeExponent)));
    if (taken.insert(patch).second) patches.push_back(patch);
  }
  return patches;
}

Eigen::Vector3d drive_of_code(const Rgb16& code, int bits) {
  return Eigen::Vector3d(code[0], code[1], code[2]) / ((1 << bits) - 1);
}

}  // namespace veneer::calibration
