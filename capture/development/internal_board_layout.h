// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <memory>
#include <vector>

#include "base/result.h"
#include "capture/plan.h"

namespace cv::aruco {
class Dictionary;
}

namespace veneer::capture {

/// Where a board's marks are: squares are black where column + row is even, the others hold the
/// markers, numbered along rows from the top (the ChArUco pattern of OpenCV 4.6).
class BoardLayout {
 public:
  /// Errors: kInvalidOption (sizes, an unknown dictionary, or one with too few markers).
  [[nodiscard]] static Result<BoardLayout> create(const MarkBoard& board);

  [[nodiscard]] const std::shared_ptr<cv::aruco::Dictionary>& dictionary() const {
    return dictionary_;
  }
  [[nodiscard]] int markers() const;
  /// Number of the marker in a square; -1 in a black one.
  [[nodiscard]] int marker_at(int column, int row) const;
  /// Its corners from the top left one clockwise, board millimetres.
  [[nodiscard]] std::array<Eigen::Vector2d, 4> marker_corners(int marker) const;
  /// Is the board black here? Board millimetres; off the board it is white.
  [[nodiscard]] bool black(const Eigen::Vector2d& board_mm) const;

 private:
  BoardLayout(const MarkBoard& board, std::shared_ptr<cv::aruco::Dictionary> dictionary);
  MarkBoard board_;
  std::shared_ptr<cv::aruco::Dictionary> dictionary_;
  std::vector<std::array<int, 2>> squares_;     ///< of each marker: column, row
  int cells_ = 0;                               ///< along a marker's side, with its black border
  std::vector<std::vector<bool>> black_cells_;  ///< of each marker, row by row
};

}  // namespace veneer::capture
