// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/statistics.h"
#include "capture/development/internal_board_layout.h"
#include "capture/development/internal_corner_fit.h"
#include "capture/development/internal_opencv.h"
#include "capture/development/rectification.h"

namespace veneer::capture {
namespace {

constexpr int kMostBoardPixels = 20000;  // a side of a drawn board
constexpr std::size_t kLeastCorners = 6;
/// The long side of the picture that markers are searched in: cells of small ones get some pixels
/// more, and a large camera's picture is searched quickly.
constexpr double kSearchSide = 1800;
constexpr double kMostUpscale = 3;
/// A marker belongs to the board if its corners are off by less, in squares: above what a lens
/// bends, below what a marker read wrongly is off by.
constexpr double kMarkerOffSquares = 0.25;
constexpr double kLeastInlierRatio = 0.6;  // of the markers read
/// A corner is fitted to this part of the squares that meet there.
constexpr double kReachOfSquare = 0.5;
/// Below this likeness something else is there: the sample's edge, a reflection, another board.
constexpr double kLeastLikeness = 0.85;
/// Corners lie on a line if they leave it by less than this part of their extent.
constexpr double kLineRatio = 0.05;

using MarkerCorners = std::vector<cv::Point2f>;

/// Mean of the channels; what is not a finite number above 0 is 0.
cv::Mat grey_of(const Image<Rgb32f>& picture) {
  cv::Mat grey(picture.height(), picture.width(), CV_32F);
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const float mean = picture(x, y).mean();
      grey.at<float>(y, x) = std::isfinite(mean) && mean > 0 ? mean : 0.0F;
    }
  }
  return grey;
}

double bright_level(const cv::Mat& grey) {
  constexpr int kMostSamples = 100000;
  const int step = std::max(1, grey.rows * grey.cols / kMostSamples);
  std::vector<double> values;
  for (int i = 0; i < grey.rows * grey.cols; i += step)
    values.push_back(grey.at<float>(i / grey.cols, i % grey.cols));
  return quantile(std::move(values), 0.99);
}

/// One way to make 8 bits of linear light.
struct Encoding {
  double blur_px = 0;  ///< against noise
  bool local = false;  ///< against the light around: a bright sample, a falling-off lamp
};
constexpr std::array kEncodings{Encoding{0, false}, Encoding{1.0, false}, Encoding{0.7, true}};

cv::Mat encoded(const cv::Mat& grey, double bright, const Encoding& encoding) {
  cv::Mat light = grey.clone();  // a copy of a Mat shares its pixels
  if (encoding.blur_px > 0) cv::GaussianBlur(grey, light, {}, encoding.blur_px);
  if (encoding.local) {
    constexpr double kNeighbourhood = 0.03;  // of the long side
    cv::Mat around;
    cv::GaussianBlur(light, around, {}, kNeighbourhood * std::max(grey.cols, grey.rows));
    light = light / (2.5 * around + 1e-3 * bright);
  } else {
    light = light / bright;
  }
  cv::Mat cut;
  cv::min(light, 1.0, cut);
  cv::pow(cut, 1 / 2.2, cut);
  cv::Mat bytes;
  cut.convertTo(bytes, CV_8U, 255);
  return bytes;
}

/// Markers that are read in any of the encodings, in pixels of OpenCV's convention.
std::map<int, MarkerCorners> read_markers(const cv::Mat& grey, const BoardLayout& layout) {
  const double scale =
      std::min(kMostUpscale, kSearchSide / static_cast<double>(std::max(grey.cols, grey.rows)));
  const double bright = bright_level(grey);
  std::map<int, MarkerCorners> markers;
  if (!(bright > 0)) return markers;
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  parameters->minMarkerPerimeterRate = 0.02;
  parameters->adaptiveThreshWinSizeMax = 43;
  parameters->perspectiveRemovePixelPerCell = 8;
  parameters->perspectiveRemoveIgnoredMarginPerCell = 0.25;
  const cv::Ptr<cv::aruco::Dictionary> dictionary(layout.dictionary());
  for (const Encoding& encoding : kEncodings) {
    cv::Mat search;
    cv::resize(encoded(grey, bright, encoding),
               search,
               {},
               scale,
               scale,
               scale > 1 ? cv::INTER_CUBIC : cv::INTER_AREA);
    std::vector<MarkerCorners> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(search, dictionary, corners, ids, parameters);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (ids[i] < 0 || ids[i] >= layout.markers()) continue;
      for (cv::Point2f& corner : corners[i])  // resize keeps edges of pixels, not centres
        corner = {static_cast<float>((corner.x + kPixelCentre) / scale - kPixelCentre),
                  static_cast<float>((corner.y + kPixelCentre) / scale - kPixelCentre)};
      markers.emplace(ids[i], corners[i]);
    }
  }
  return markers;
}

/// Drops markers that do not lie where the others say; nothing where the most do not agree.
void keep_those_that_agree(std::map<int, MarkerCorners>& markers,
                           const BoardLayout& layout,
                           const MarkBoard& board) {
  std::vector<cv::Point2f> pixels;
  std::vector<cv::Point2f> places;
  for (const auto& [id, corners] : markers) {
    const auto own = layout.marker_corners(id);
    for (std::size_t i = 0; i < 4; ++i) {
      pixels.push_back(corners[i]);
      places.emplace_back(static_cast<float>(own[i].x()), static_cast<float>(own[i].y()));
    }
  }
  cv::Mat inliers;
  const cv::Mat mm_from_px = markers.size() < 2
                                 ? cv::Mat()
                                 : cv::findHomography(pixels,
                                                      places,
                                                      cv::RANSAC,
                                                      kMarkerOffSquares * board.square_mm,
                                                      inliers,
                                                      2000,
                                                      0.999);
  if (mm_from_px.empty()) {
    markers.clear();
    return;
  }
  const std::size_t read = markers.size();
  int corner = 0;
  for (auto marker = markers.begin(); marker != markers.end(); corner += 4) {
    int good = 0;
    for (int i = 0; i < 4; ++i) good += inliers.at<std::uint8_t>(corner + i) != 0 ? 1 : 0;
    marker = good == 4 ? std::next(marker) : markers.erase(marker);
  }
  if (static_cast<double>(markers.size()) < kLeastInlierRatio * static_cast<double>(read))
    markers.clear();
}

struct Guess {
  Eigen::Vector2d board_mm;
  int id;
  Eigen::Matrix3d pixel_from_mm;  ///< around it
};

/// Where the inner corners between two markers that were read should be.
std::vector<Guess> guess_corners(const std::map<int, MarkerCorners>& markers,
                                 const BoardLayout& layout,
                                 const MarkBoard& board) {
  std::vector<Guess> guesses;
  for (int row = 1; row < board.rows; ++row) {
    for (int column = 1; column < board.columns; ++column) {
      std::vector<cv::Point2f> places;
      std::vector<cv::Point2f> pixels;
      for (const auto& [x, y] : {std::array{column - 1, row - 1},
                                 std::array{column, row - 1},
                                 std::array{column - 1, row},
                                 std::array{column, row}}) {
        const auto marker = markers.find(layout.marker_at(x, y));
        if (marker == markers.end()) continue;
        const auto own = layout.marker_corners(marker->first);
        for (std::size_t i = 0; i < 4; ++i) {
          // Around the corner, so that the equations are well conditioned.
          const Eigen::Vector2d place = own[i] / board.square_mm - Eigen::Vector2d(column, row);
          places.emplace_back(static_cast<float>(place.x()), static_cast<float>(place.y()));
          pixels.push_back(marker->second[i]);
        }
      }
      if (pixels.size() != 8) continue;
      const cv::Mat solved = cv::findHomography(places, pixels, 0);
      if (solved.empty()) continue;
      Eigen::Matrix3d opencv_from_squares;
      for (int i = 0; i < 9; ++i)
        opencv_from_squares(i / 3, i % 3) = solved.at<double>(i / 3, i % 3);
      Eigen::Matrix3d squares_from_mm = Eigen::Matrix3d::Identity() / board.square_mm;
      squares_from_mm.col(2) = Eigen::Vector3d(-column, -row, 1);
      Eigen::Matrix3d pixel_from_opencv = Eigen::Matrix3d::Identity();
      pixel_from_opencv.col(2) = Eigen::Vector3d(kPixelCentre, kPixelCentre, 1);
      guesses.push_back({Eigen::Vector2d(column, row) * board.square_mm,
                         (row - 1) * (board.columns - 1) + column - 1,
                         pixel_from_opencv * opencv_from_squares * squares_from_mm});
    }
  }
  return guesses;
}

bool on_a_line(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) middle += point / static_cast<double>(points.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& point : points)
    spread += (point - middle) * (point - middle).transpose();
  const Eigen::Vector2d values =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues().cwiseMax(0).cwiseSqrt();
  return !(values[0] > kLineRatio * values[1]);
}

Result<FoundMarks> search(const Image<Rgb32f>& picture,
                          const MarkBoard& board,
                          const BoardLayout& layout) {
  const cv::Mat grey = grey_of(picture);
  std::map<int, MarkerCorners> markers = read_markers(grey, layout);
  const std::size_t read = markers.size();
  keep_those_that_agree(markers, layout, board);

  FoundMarks found;
  for (const Guess& guess : guess_corners(markers, layout, board)) {
    const auto fit = fit_corner(
        grey, layout, guess.pixel_from_mm, guess.board_mm, kReachOfSquare * board.square_mm);
    if (!fit || fit->likeness < kLeastLikeness) continue;
    found.ids.push_back(guess.id);
    found.pixels.push_back(fit->pixel);
    found.board_mm.push_back(guess.board_mm);
  }
  if (found.ids.size() < kLeastCorners) {
    return fail(Errc::kNotFound,
                "looking for the board of {} x {} squares ({}): {} of its {} markers were read, {} "
                "where the others say, and {} corners found, {} are needed; check that the plan's "
                "[board] is the one that lies there, that more of it shows around the sample, "
                "sharp, and that it is lit",
                board.columns,
                board.rows,
                board.dictionary,
                read,
                layout.markers(),
                markers.size(),
                found.ids.size(),
                kLeastCorners);
  }
  if (on_a_line(found.board_mm)) {
    return fail(Errc::kNotFound,
                "looking for the board: its {} corners that show are nearly on a line, which tells "
                "no plane; uncover the board on a second side of the sample",
                found.ids.size());
  }
  return found;
}

}  // namespace

Result<Image<std::uint8_t>> draw_board(const MarkBoard& board, double pixels_per_mm) {
  VENEER_ASSIGN(const BoardLayout layout, BoardLayout::create(board));
  const double width = std::round(board.columns * board.square_mm * pixels_per_mm);
  const double height = std::round(board.rows * board.square_mm * pixels_per_mm);
  if (!(width >= 1 && height >= 1 && std::max(width, height) <= kMostBoardPixels)) {
    return fail(Errc::kInvalidOption,
                "drawing the board at {} pixels a millimetre: it would be {} x {} pixels; 1 to {} "
                "are drawn",
                pixels_per_mm,
                width,
                height,
                kMostBoardPixels);
  }
  Image<std::uint8_t> drawn(static_cast<int>(width), static_cast<int>(height));
  for (int y = 0; y < drawn.height(); ++y)
    for (int x = 0; x < drawn.width(); ++x)
      drawn(x, y) =
          layout.black(Eigen::Vector2d(x + kPixelCentre, y + kPixelCentre) / pixels_per_mm) ? 0
                                                                                            : 255;
  return drawn;
}

Result<FoundMarks> find_marks(const Image<Rgb32f>& picture, const MarkBoard& board) {
  VENEER_ASSIGN(const BoardLayout layout, BoardLayout::create(board));
  if (picture.empty())
    return fail(Errc::kNotFound, "looking for the board: the picture is empty; take it again");
  try {
    return search(picture, board, layout);
  } catch (const cv::Exception& error) {
    return fail(Errc::kNotFound, "looking for the board: OpenCV says {}", error.what());
  }
}

}  // namespace veneer::capture
