// SPDX-License-Identifier: Apache-2.0
#include <opencv2/aruco.hpp>

#include <cmath>

#include "capture/development/internal_board_layout.h"

namespace veneer::capture {
namespace {

constexpr int kMostSquares = 200;

struct DictionaryName {
  const char* name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME value;
};
constexpr std::array kDictionaries{
    DictionaryName{"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    DictionaryName{"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    DictionaryName{"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    DictionaryName{"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    DictionaryName{"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    DictionaryName{"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    DictionaryName{"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    DictionaryName{"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    DictionaryName{"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    DictionaryName{"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    DictionaryName{"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    DictionaryName{"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    DictionaryName{"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    DictionaryName{"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    DictionaryName{"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    DictionaryName{"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
};

}  // namespace

Result<BoardLayout> BoardLayout::create(const MarkBoard& board) {
  if (board.columns < 3 || board.rows < 3 || board.columns > kMostSquares ||
      board.rows > kMostSquares) {
    return fail(Errc::kInvalidOption,
                "a board of {} x {} squares: give 3 to {} a side",
                board.columns,
                board.rows,
                kMostSquares);
  }
  if (!(board.square_mm > 0) || !std::isfinite(board.square_mm) || !(board.marker_mm > 0) ||
      !(board.marker_mm < board.square_mm)) {
    return fail(Errc::kInvalidOption,
                "a board with squares of {} mm and markers of {} mm: both have to be above 0, and "
                "a marker smaller than its square",
                board.square_mm,
                board.marker_mm);
  }
  for (const DictionaryName& entry : kDictionaries) {
    if (board.dictionary != entry.name) continue;
    try {
      const auto dictionary = cv::aruco::getPredefinedDictionary(entry.value);
      if (dictionary->bytesList.rows < board.columns * board.rows / 2) {
        return fail(Errc::kInvalidOption,
                    "a board of {} x {} squares needs {} markers, and the dictionary {} has {}; "
                    "take a larger one or a smaller board",
                    board.columns,
                    board.rows,
                    board.columns * board.rows / 2,
                    board.dictionary,
                    dictionary->bytesList.rows);
      }
      return BoardLayout(board, dictionary);
    } catch (const cv::Exception& error) {
      return fail(
          Errc::kInvalidOption, "dictionary {}: OpenCV says {}", board.dictionary, error.what());
    }
  }
  return fail(Errc::kInvalidOption,
              "the board's dictionary is '{}'; give DICT_NXN_COUNT with N from 4 to 7 and COUNT "
              "50, 100, 250 or 1000, for example DICT_4X4_100",
              board.dictionary);
}

BoardLayout::BoardLayout(const MarkBoard& board, std::shared_ptr<cv::aruco::Dictionary> dictionary)
    : board_(board), dictionary_(std::move(dictionary)), cells_(dictionary_->markerSize + 2) {
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      if (marker_at(column, row) >= 0) squares_.push_back({column, row});
  for (int marker = 0; marker < markers(); ++marker) {
    cv::Mat drawn;
    dictionary_->drawMarker(marker, cells_, drawn, 1);
    std::vector<bool>& cells = black_cells_.emplace_back();
    for (int y = 0; y < cells_; ++y)
      for (int x = 0; x < cells_; ++x) cells.push_back(drawn.at<std::uint8_t>(y, x) < 128);
  }
}

int BoardLayout::markers() const { return static_cast<int>(squares_.size()); }

int BoardLayout::marker_at(int column, int row) const {
  if ((column + row) % 2 == 0) return -1;
  return (row * board_.columns + column) / 2;
}

std::array<Eigen::Vector2d, 4> BoardLayout::marker_corners(int marker) const {
  const auto [column, row] = squares_[static_cast<std::size_t>(marker)];
  const double margin = (board_.square_mm - board_.marker_mm) / 2;
  const Eigen::Vector2d corner(column * board_.square_mm + margin, row * board_.square_mm + margin);
  const double side = board_.marker_mm;
  return {corner,
          corner + Eigen::Vector2d(side, 0),
          corner + Eigen::Vector2d(side, side),
          corner + Eigen::Vector2d(0, side)};
}

bool BoardLayout::black(const Eigen::Vector2d& board_mm) const {
  const Eigen::Vector2d square = board_mm / board_.square_mm;
  if (!(square.x() >= 0 && square.y() >= 0 && square.x() < board_.columns &&
        square.y() < board_.rows))
    return false;
  const int marker = marker_at(static_cast<int>(square.x()), static_cast<int>(square.y()));
  if (marker < 0) return true;
  const Eigen::Vector2d cell = (board_mm - marker_corners(marker)[0]) * (cells_ / board_.marker_mm);
  if (!(cell.x() >= 0 && cell.y() >= 0 && cell.x() < cells_ && cell.y() < cells_)) return false;
  return black_cells_[static_cast<std::size_t>(marker)][static_cast<std::size_t>(
      static_cast<int>(cell.y()) * cells_ + static_cast<int>(cell.x()))];
}

}  // namespace veneer::capture
