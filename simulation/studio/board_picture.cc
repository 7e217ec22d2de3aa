// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/board_picture.h"

#include <opencv2/aruco/charuco.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace veneer::simulation::studio {
namespace {

using Named = std::pair<std::string_view, cv::aruco::PREDEFINED_DICTIONARY_NAME>;
constexpr std::array kDictionaries{
    Named{"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    Named{"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    Named{"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    Named{"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    Named{"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    Named{"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    Named{"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    Named{"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    Named{"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    Named{"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    Named{"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    Named{"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    Named{"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    Named{"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    Named{"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    Named{"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
};

// A whole number for a square, so that its corners, by which pictures are measured, are exact. Ten
// squares of 10 mm are then drawn 24 pixels a millimetre fine.
constexpr int kPixelsPerSquare = 240;
constexpr int kMostSquares = 60;  // along a side: 14400 pixels

}  // namespace

Result<BoardPicture> BoardPicture::draw(const capture::MarkBoard& board) {
  const auto* const named =
      std::ranges::find(kDictionaries, std::string_view(board.dictionary), &Named::first);
  if (named == kDictionaries.end())
    return fail(Errc::kInvalidOption,
                "drawing the studio's board: there is no dictionary \"{}\"; name one of OpenCV's, "
                "DICT_4X4_100 for example",
                board.dictionary);
  if (board.columns < 3 || board.rows < 3 || board.columns > kMostSquares ||
      board.rows > kMostSquares)
    return fail(Errc::kInvalidOption,
                "drawing the studio's board: it has {} x {} squares; give 3 to {} along each side",
                board.columns,
                board.rows,
                kMostSquares);
  if (!(board.square_mm > 0) || !std::isfinite(board.square_mm) || !(board.marker_mm > 0) ||
      !(board.marker_mm < board.square_mm))
    return fail(Errc::kInvalidOption,
                "drawing the studio's board: squares of {} mm cannot hold markers of {} mm; give "
                "markers that are smaller than the squares",
                board.square_mm,
                board.marker_mm);
  try {
    const auto dictionary = cv::aruco::getPredefinedDictionary(named->second);
    if (board.columns * board.rows / 2 > dictionary->bytesList.rows)
      return fail(Errc::kInvalidOption,
                  "drawing the studio's board: {} x {} squares need {} marks, and {} has {}; take "
                  "a larger dictionary",
                  board.columns,
                  board.rows,
                  board.columns * board.rows / 2,
                  board.dictionary,
                  dictionary->bytesList.rows);
    const auto charuco = cv::aruco::CharucoBoard::create(board.columns,
                                                         board.rows,
                                                         static_cast<float>(board.square_mm),
                                                         static_cast<float>(board.marker_mm),
                                                         dictionary);
    cv::Mat drawn;
    charuco->draw({board.columns * kPixelsPerSquare, board.rows * kPixelsPerSquare}, drawn);
    Image<std::uint8_t> picture(drawn.cols, drawn.rows);
    for (int y = 0; y < drawn.rows; ++y)
      std::copy_n(drawn.ptr<std::uint8_t>(y), drawn.cols, picture.view().row(y).begin());
    return BoardPicture(std::move(picture), kPixelsPerSquare / board.square_mm);
  } catch (const cv::Exception& error) {
    return fail(Errc::kInvalidOption, "drawing the studio's board: OpenCV says: {}", error.what());
  }
}

float BoardPicture::reflectance(const Eigen::Vector2d& board_mm) const {
  const double x = std::floor(board_mm.x() * pixels_per_mm_);
  const double y = std::floor(board_mm.y() * pixels_per_mm_);
  if (!(x >= 0 && y >= 0 && x < picture_.width() && y < picture_.height())) return kTable;
  return picture_(static_cast<int>(x), static_cast<int>(y)) > 127 ? kWhite : kBlack;
}

}  // namespace veneer::simulation::studio
