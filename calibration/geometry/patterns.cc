// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/patterns.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace veneer::geometry {
namespace {

constexpr int kMostSide = 16384;  // of a raster: above any projector's
constexpr int kLeastPeriod = 4;   // pixels: below, a pixel's own width blurs the sinusoid away
constexpr int kMostShifts = 64;   // more pictures would cost more than they tell

/// Bits that count `codes` different values; at least 1.
int bits_for(int codes) {
  int bits = 1;
  while ((1 << bits) < codes) ++bits;
  return bits;
}

void add_gray(PatternPlan& plan, PatternAxis axis, int bits) {
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (const bool inverse : {false, true})
      plan.patterns.push_back({PatternKind::kGray, axis, bit, inverse, 0});
  }
}

Status check_raster(int width, int height, int step) {
  if (width < 2 || height < 2 || width > kMostSide || height > kMostSide) {
    return fail(Errc::kInvalidOption,
                "planning patterns: a raster of {} x {} pixels; each side has to be 2 to {}",
                width,
                height,
                kMostSide);
  }
  if (step < 1 || step > std::min(width, height) / 2) {
    return fail(Errc::kInvalidOption,
                "planning patterns: a Gray code of blocks of {} pixels on {} x {}; give 1 to {}",
                step,
                width,
                height,
                std::min(width, height) / 2);
  }
  return {};
}

/// Width and step checked.
PatternPlan make_plan(int width, int height, int step, int shifts) {
  PatternPlan plan;
  plan.width = width;
  plan.height = height;
  plan.step = step;
  plan.shifts = shifts;
  plan.period = shifts > 0 ? 2 * step : 0;
  plan.column_bits = bits_for((width + step - 1) / step);
  plan.row_bits = bits_for((height + step - 1) / step);
  add_gray(plan, PatternAxis::kColumns, plan.column_bits);
  add_gray(plan, PatternAxis::kRows, plan.row_bits);
  for (const PatternAxis axis : {PatternAxis::kColumns, PatternAxis::kRows}) {
    for (int shift = 0; shift < shifts; ++shift)
      plan.patterns.push_back({PatternKind::kPhase, axis, 0, false, shift});
  }
  plan.patterns.push_back({PatternKind::kWhite, {}, 0, false, 0});
  plan.patterns.push_back({PatternKind::kBlack, {}, 0, false, 0});
  return plan;
}

}  // namespace

std::string Pattern::name() const {
  const char* along = axis == PatternAxis::kColumns ? "columns" : "rows";
  switch (kind) {
    case PatternKind::kGray:
      return fmt::format("{} bit {}{}", along, bit, inverse ? ", inverse" : "");
    case PatternKind::kPhase:
      return fmt::format("{} phase {}", along, shift);
    case PatternKind::kWhite:
      return "white";
    case PatternKind::kBlack:
      return "black";
  }
  return {};
}

Result<PatternPlan> gray_code_plan(int width, int height, int step) {
  VENEER_TRY(check_raster(width, height, step));
  return make_plan(width, height, step, 0);
}

Result<PatternPlan> phase_shift_plan(int width, int height, int period, int shifts) {
  if (period < kLeastPeriod || period % 2 != 0) {
    return fail(Errc::kInvalidOption,
                "planning patterns: sinusoids with a period of {} pixels; give an even number, at "
                "least {}",
                period,
                kLeastPeriod);
  }
  if (shifts < 3 || shifts > kMostShifts) {
    return fail(Errc::kInvalidOption,
                "planning patterns: {} shifts of a sinusoid; give 3 to {}",
                shifts,
                kMostShifts);
  }
  VENEER_TRY(check_raster(width, height, period / 2));
  return make_plan(width, height, period / 2, shifts);
}

double pattern_level(const PatternPlan& plan, int index, int x, int y) {
  VENEER_CHECK(index >= 0 && index < plan.pictures());
  const Pattern& pattern = plan.patterns[static_cast<std::size_t>(index)];
  const int along = pattern.axis == PatternAxis::kColumns ? x : y;
  switch (pattern.kind) {
    case PatternKind::kGray: {
      const auto code = static_cast<unsigned>(along / plan.step);
      const unsigned gray = code ^ (code >> 1U);
      return (((gray >> static_cast<unsigned>(pattern.bit)) & 1U) != 0) != pattern.inverse ? 1 : 0;
    }
    case PatternKind::kPhase:
      return 0.5 + 0.5 * std::cos(2 * std::numbers::pi *
                                  ((along + 0.5) / plan.period -
                                   static_cast<double>(pattern.shift) / plan.shifts));
    case PatternKind::kWhite:
      return 1;
    case PatternKind::kBlack:
      return 0;
  }
  return 0;
}

Image<std::uint8_t> draw_pattern(const PatternPlan& plan, int index) {
  Image<std::uint8_t> image(plan.width, plan.height);
  for (int y = 0; y < plan.height; ++y) {
    for (int x = 0; x < plan.width; ++x)
      image(x, y) = static_cast<std::uint8_t>(std::lround(255 * pattern_level(plan, index, x, y)));
  }
  return image;
}

Image<Rgb16> draw_pattern_codes(const PatternPlan& plan,
                                int index,
                                int bits,
                                std::span<const double> tone_curve) {
  VENEER_CHECK(bits >= 1 && bits <= 16);
  VENEER_CHECK(tone_curve.empty() || tone_curve.size() == std::size_t{1} << bits);
  const double last = (1 << bits) - 1;
  const auto code_of = [&](double level) {
    if (tone_curve.empty()) return static_cast<std::uint16_t>(std::lround(last * level));
    auto above = std::ranges::lower_bound(tone_curve, level);
    if (above == tone_curve.end()) --above;
    if (above != tone_curve.begin() && level - *(above - 1) < *above - level) --above;
    return static_cast<std::uint16_t>(above - tone_curve.begin());
  };
  Image<Rgb16> image(plan.width, plan.height);
  for (int y = 0; y < plan.height; ++y) {
    for (int x = 0; x < plan.width; ++x) {
      const std::uint16_t code = code_of(pattern_level(plan, index, x, y));
      image(x, y) = {code, code, code};
    }
  }
  return image;
}

}  // namespace veneer::geometry
