// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>

#include "base/image.h"
#include "base/result.h"
#include "capture/plan.h"

namespace veneer::simulation::studio {

/// The printed board of ChArUco marks, as it is lit.
class BoardPicture {
 public:
  static constexpr double kWhite = 0.85;  ///< reflectance of the paper, Lambertian
  static constexpr double kBlack = 0.04;  ///< of the ink
  static constexpr double kTable = 0.02;  ///< of what the board lies on

  /// Errors: kInvalidOption (no such dictionary, more marks than it has, sizes).
  [[nodiscard]] static Result<BoardPicture> draw(const capture::MarkBoard& board);
  /// Reflectance at a place; the table's off the board.
  /// @param board_mm  from the board's top left corner, x right, y down; finite.
  [[nodiscard]] float reflectance(const Eigen::Vector2d& board_mm) const;

 private:
  BoardPicture(Image<std::uint8_t> ink, double pixels_per_mm)
      : picture_(std::move(ink)), pixels_per_mm_(pixels_per_mm) {}
  Image<std::uint8_t> picture_;  // 0 is ink
  double pixels_per_mm_;
};

}  // namespace veneer::simulation::studio
