// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace veneer::geometry {

/// Which coordinate of the projector's raster a pattern tells.
enum class PatternAxis { kColumns, kRows };

enum class PatternKind {
  kGray,   ///< one bit of a Gray code, black and white
  kPhase,  ///< one shift of a sinusoid
  kWhite,  ///< all lit
  kBlack,  ///< all dark
};

/// What one picture of a sequence is.
struct Pattern {
  PatternKind kind = PatternKind::kWhite;
  PatternAxis axis = PatternAxis::kColumns;  ///< of kGray and kPhase
  int bit = 0;                               ///< of kGray: 0 is the least significant
  bool inverse = false;                      ///< of kGray: black and white exchanged
  int shift = 0;                             ///< of kPhase: 0 to PatternPlan::shifts - 1

  [[nodiscard]] std::string name() const;  ///< such as "columns bit 9, inverse"
};

/// A sequence of pictures that tells every projector pixel from every other, and what picture i is.
/// The order is: the Gray code of the columns, most significant bit first, each picture followed by
/// its inverse; that of the rows; the sinusoids of the columns and of the rows, if any; white;
/// black. Without sinusoids that is the order of OpenCV's GrayCodePattern, white and black
/// appended.
struct PatternPlan {
  int width = 0;   ///< of the projector's raster, pixels
  int height = 0;  ///< likewise
  /// The Gray code counts blocks of so many pixels: pixel x, counted from 0, has the code x / step.
  int step = 1;
  int shifts = 0;  ///< pictures of each sinusoid; 0 for Gray code alone
  int period = 0;  ///< of the sinusoids, pixels: 2 * step
  int column_bits = 0;
  int row_bits = 0;
  std::vector<Pattern> patterns;

  [[nodiscard]] int pictures() const { return static_cast<int>(patterns.size()); }
};

/// Gray code and inverses alone: a position is known to the middle of a block of `step` pixels.
/// Errors: kInvalidOption (a side outside 2 to 16384, a step outside 1 to half of the shorter
/// side).
[[nodiscard]] Result<PatternPlan> gray_code_plan(int width, int height, int step);

/// Gray code of half periods, and sinusoids that divide a period: positions to parts of a pixel.
/// The half periods overlap the phase's own steps, so that a wrong finest bit costs nothing.
/// @param period  pixels, even, at least 4.   @param shifts  at least 3; from 4 on the second
///                harmonic, which a tone curve that is not undone makes, cancels.
/// Errors: kInvalidOption.
[[nodiscard]] Result<PatternPlan> phase_shift_plan(int width, int height, int period, int shifts);

/// What pixel (x, y) of picture `index` sends, in [0, 1] of white, linear.
[[nodiscard]] double pattern_level(const PatternPlan& plan, int index, int x, int y);

/// Picture `index` in 8 bits: 0, 255, and for sinusoids what is between.
[[nodiscard]] Image<std::uint8_t> draw_pattern(const PatternPlan& plan, int index);

/// Picture `index` in drive codes, all three channels alike.
/// @param bits  of a code, 1 to 16.   @param tone_curve  2^bits values, rising from 0 to 1:
/// relative
///              output of every code; the code nearest to the wanted light is taken. Empty: output
///              is taken as proportional to the code.
[[nodiscard]] Image<Rgb16> draw_pattern_codes(const PatternPlan& plan,
                                              int index,
                                              int bits,
                                              std::span<const double> tone_curve = {});

}  // namespace veneer::geometry
