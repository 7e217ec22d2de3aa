// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/board_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <vector>

namespace veneer::simulation::studio {
namespace {

using ::testing::HasSubstr;

Result<BoardPicture> drawn(int columns, int rows) {
  return BoardPicture::draw({columns, rows, 6, 4.2, "DICT_4X4_100"});
}

TEST(BoardPicture, SquaresAlternateAndTheirCornersAreExact) {
  const auto board = drawn(11, 9);
  ASSERT_TRUE(board) << board.error().what;
  for (int row = 0; row < 9; ++row)
    for (int column = 0; column < 11; ++column)
      // Just inside its corners a square of marks is as white as an ink one is black.
      for (const double x : {0.01, 5.99})
        for (const double y : {0.01, 5.99})
          EXPECT_EQ(board->reflectance({6 * column + x, 6 * row + y}),
                    static_cast<float>((column + row) % 2 == 0 ? BoardPicture::kBlack
                                                               : BoardPicture::kWhite))
              << column << ", " << row;
}

TEST(BoardPicture, EveryWhiteSquareHoldsAMarkWithABlackRim) {
  const auto board = drawn(11, 9);
  ASSERT_TRUE(board);
  for (int row = 0; row < 9; ++row)
    for (int column = 0; column < 11; ++column) {
      if ((column + row) % 2 == 0) continue;
      // The rim is one of six cells wide, 0.9 mm from the square's edge.
      for (const double along : {1.2, 3.0, 4.8}) {
        EXPECT_EQ(board->reflectance({6 * column + along, 6 * row + 1.2}),
                  static_cast<float>(BoardPicture::kBlack));
        EXPECT_EQ(board->reflectance({6 * column + 4.8, 6 * row + along}),
                  static_cast<float>(BoardPicture::kBlack));
        EXPECT_EQ(board->reflectance({6 * column + along, 6 * row + 0.8}),
                  static_cast<float>(BoardPicture::kWhite));
      }
    }
}

TEST(BoardPicture, AroundItIsTheTable) {
  const auto board = drawn(4, 3);
  ASSERT_TRUE(board);
  constexpr double kFar = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& place : std::vector<Eigen::Vector2d>{
           {-0.01, 5}, {5, -0.01}, {24.01, 5}, {5, 18.01}, {kFar, 5}, {5, -kFar}})
    EXPECT_EQ(board->reflectance(place), static_cast<float>(BoardPicture::kTable));
  EXPECT_NE(board->reflectance({0, 0}), static_cast<float>(BoardPicture::kTable));
}

TEST(BoardPicture, ABoardThatCannotBeIsRefused) {
  const auto expect_refused = [](const std::function<void(capture::MarkBoard&)>& change,
                                 const char* reason) {
    capture::MarkBoard board;
    change(board);
    const auto picture = BoardPicture::draw(board);
    ASSERT_FALSE(picture) << reason;
    EXPECT_EQ(picture.error().code, Errc::kInvalidOption);
    EXPECT_THAT(picture.error().what, HasSubstr(reason));
  };
  expect_refused([](auto& b) { b.dictionary = "DICT_9X9"; }, "DICT_9X9");
  expect_refused([](auto& b) { b.columns = 2; }, "2 x 11");
  expect_refused([](auto& b) { b.rows = 100; }, "14 x 100");
  expect_refused([](auto& b) { b.marker_mm = b.square_mm; }, "smaller than the squares");
  expect_refused([](auto& b) { b.square_mm = std::numeric_limits<double>::quiet_NaN(); }, "nan");
  expect_refused([](auto& b) { b.dictionary = "DICT_4X4_50"; }, "larger dictionary");
}

}  // namespace
}  // namespace veneer::simulation::studio
