// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/board.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"

namespace veneer::geometry {
namespace {

constexpr double kCentre = 0.5;           // OpenCV's first pixel centre is (0, 0), ours (0.5, 0.5)
constexpr double kWindowOfSpacing = 0.7;  // half a window: it reaches into all four squares
constexpr int kMostHalfWindow = 40;       // camera pixels; a lens bends more than a homography can
constexpr int kLeastHalfWindow = 6;       // fewer pixels average out no blocks
/// A decoded pixel belongs to the plane if it is off by less than so many blocks, and a pixel.
constexpr double kInlierBlocks = 1.0;
constexpr int kLeastInliers = 30;           // for eight numbers
constexpr double kLeastInlierRatio = 0.6;   // of the decoded pixels
constexpr double kLeastDecodedRatio = 0.3;  // of a window's area
constexpr double kLeastSideRatio = 0.15;    // of the inliers, so that a corner lies between them
constexpr double kGoodPatternRatio = 0.5;   // of the lit pixels, below which a picture is suspect
/// Half the side of the square in which a corner is refined, camera pixels, and its part of the
/// spacing, so that no other corner comes in.
constexpr int kMostRefineWindow = 5;
constexpr double kRefineOfSpacing = 0.3;

/// Least distance of neighbouring corners, pixels.
double least_spacing(const std::vector<cv::Point2f>& corners, const Board& board) {
  double least = std::numeric_limits<double>::infinity();
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const cv::Point2f here = corners[static_cast<std::size_t>(row * board.columns + column)];
      if (column + 1 < board.columns)
        least = std::min(
            least,
            cv::norm(corners[static_cast<std::size_t>(row * board.columns + column + 1)] - here));
      if (row + 1 < board.rows)
        least = std::min(
            least,
            cv::norm(corners[static_cast<std::size_t>((row + 1) * board.columns + column)] - here));
    }
  }
  return least;
}

double median_spacing(const std::vector<Eigen::Vector2d>& corners, const Board& board) {
  std::vector<double> spacings;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column + 1 < board.columns; ++column) {
      const auto i = static_cast<std::size_t>(row * board.columns + column);
      spacings.push_back((corners[i + 1] - corners[i]).norm());
    }
  }
  return quantile(spacings, 0.5);
}

}  // namespace

Status Board::check() const {
  if (columns < 3 || rows < 3 || columns > 200 || rows > 200 || !(square > 0) ||
      !std::isfinite(square)) {
    return fail(Errc::kInvalidOption,
                "a board of {} x {} inner corners with squares of {}: give 3 to 200 corners a side "
                "and a square above 0",
                columns,
                rows,
                square);
  }
  return {};
}

std::vector<Eigen::Vector3d> Board::corners() const {
  std::vector<Eigen::Vector3d> points;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      points.emplace_back(square * column, square * row, 0);
  }
  return points;
}

Status BoardOptions::check() const {
  VENEER_TRY(decoding.check());
  if (half_window != 0 && (half_window < kLeastHalfWindow || half_window > 500)) {
    return fail(Errc::kInvalidOption,
                "reading a board: half_window is {}; give 0 or {} to 500 camera pixels",
                half_window,
                kLeastHalfWindow);
  }
  return {};
}

Result<std::vector<Eigen::Vector2d>> find_board(ImageView<const std::uint16_t> picture,
                                                const Board& board) {
  VENEER_TRY(board.check());
  std::uint16_t most = 0;
  for (int y = 0; y < picture.height(); ++y)
    for (const std::uint16_t count : picture.row(y)) most = std::max(most, count);
  std::vector<cv::Point2f> corners;
  bool found = false;
  try {
    // 8 bits suffice to find the squares; the corners are refined in all that there are.
    cv::Mat full(picture.height(), picture.width(), CV_32F);
    for (int y = 0; y < picture.height(); ++y)
      std::ranges::copy(picture.row(y), full.ptr<float>(y));
    cv::Mat eight_bit;
    full.convertTo(eight_bit, CV_8U, most > 0 ? 255.0 / most : 1.0);
    found = !picture.empty() &&
            cv::findChessboardCorners(eight_bit, {board.columns, board.rows}, corners);
    if (found) {
      const int window = std::clamp(
          static_cast<int>(kRefineOfSpacing * least_spacing(corners, board)), 2, kMostRefineWindow);
      cv::cornerSubPix(full,
                       corners,
                       {window, window},
                       {-1, -1},
                       {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
    }
  } catch (const cv::Exception& error) {
    return fail(Errc::kBadFormat, "looking for the board: OpenCV says {}", error.what());
  }
  if (!found) {
    return fail(Errc::kNotFound,
                "looking for the board: no chessboard of {} x {} inner corners is in the white "
                "picture; it has to be seen whole, with a white border, not too dark and not "
                "saturated, and the corners are to be counted where four squares meet",
                board.columns,
                board.rows);
  }
  std::vector<Eigen::Vector2d> points;
  for (const cv::Point2f& corner : corners)
    points.emplace_back(corner.x + kCentre, corner.y + kCentre);
  return points;
}

LocalMapping map_to_projector(const DecodedView& decoded,
                              const Eigen::Vector2d& camera_pixel,
                              int half_window) {
  LocalMapping mapping;
  const int x0 = std::max(0, static_cast<int>(std::floor(camera_pixel.x())) - half_window);
  const int y0 = std::max(0, static_cast<int>(std::floor(camera_pixel.y())) - half_window);
  const int x1 = std::min(decoded.lit.width(),
                          static_cast<int>(std::floor(camera_pixel.x())) + half_window + 1);
  const int y1 = std::min(decoded.lit.height(),
                          static_cast<int>(std::floor(camera_pixel.y())) + half_window + 1);
  // Around the middle of each, so that the equations are well conditioned.
  std::vector<cv::Point2f> from;
  std::vector<Eigen::Vector2f> lights;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      mapping.lit += decoded.lit(x, y);
      const Eigen::Vector2f& light = decoded.projector(x, y);
      if (!light.allFinite()) continue;
      from.emplace_back(static_cast<float>(x + kCentre - camera_pixel.x()),
                        static_cast<float>(y + kCentre - camera_pixel.y()));
      lights.push_back(light);
    }
  }
  mapping.pixels = static_cast<int>(from.size());
  const int area = (2 * half_window + 1) * (2 * half_window + 1);
  if (mapping.pixels < kLeastInliers || mapping.pixels < kLeastDecodedRatio * area) return mapping;
  Eigen::Vector2f middle = Eigen::Vector2f::Zero();
  for (const Eigen::Vector2f& light : lights) middle += light / static_cast<float>(lights.size());
  std::vector<cv::Point2f> to;
  for (const Eigen::Vector2f& light : lights)
    to.emplace_back(light.x() - middle.x(), light.y() - middle.y());

  cv::Mat mask;
  cv::Mat h;
  try {
    h = cv::findHomography(
        from, to, cv::RANSAC, kInlierBlocks * decoded.resolution_px + 1, mask, 500, 0.999);
  } catch (const cv::Exception&) {
    return mapping;  // what it throws at is a set without a homography
  }
  if (h.empty() || !(std::abs(h.at<double>(2, 2)) > 0)) return mapping;
  Eigen::Matrix3d matrix;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) matrix(row, column) = h.at<double>(row, column);
  double sum = 0;
  std::array<int, 4> sides{};  // inliers left, right, above and below
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (mask.at<std::uint8_t>(static_cast<int>(i)) == 0) continue;
    const Eigen::Vector3d image = matrix * Eigen::Vector3d(from[i].x, from[i].y, 1);
    sum += (image.head<2>() / image.z() - Eigen::Vector2d(to[i].x, to[i].y)).squaredNorm();
    ++mapping.inliers;
    ++sides[from[i].x < 0 ? 0 : 1];
    ++sides[from[i].y < 0 ? 2 : 3];
  }
  mapping.projector =
      middle.cast<double>() + Eigen::Vector2d(matrix(0, 2), matrix(1, 2)) / matrix(2, 2);
  mapping.rms_px = mapping.inliers > 0 ? std::sqrt(sum / mapping.inliers) : 0;
  mapping.good =
      mapping.inliers >= kLeastInliers && mapping.inliers >= kLeastInlierRatio * mapping.pixels &&
      std::ranges::all_of(sides,
                          [&](int count) { return count >= kLeastSideRatio * mapping.inliers; }) &&
      mapping.projector.allFinite();
  return mapping;
}

Result<BoardView> observe_board(const std::string& name,
                                std::span<const GreyPicture> pictures,
                                const PatternPlan& plan,
                                const Board& board,
                                const BoardOptions& options) {
  const auto failed = [&](const Error& error) { return fail_while("pose " + name, error); };
  if (const Status good = options.check(); !good) return failed(good.error());
  if (const Status good = board.check(); !good) return failed(good.error());
  const Result<DecodedView> decoded = decode(pictures, plan, options.decoding);
  if (!decoded) return failed(decoded.error());
  const GreyPicture& white = pictures[pictures.size() - 2];
  const Result<std::vector<Eigen::Vector2d>> corners = find_board(white.view(), board);
  if (!corners) return failed(corners.error());

  BoardView result;
  result.view.name = name;
  result.view.x_in_object = board.corners();
  result.view.camera = *corners;
  result.corners = board.columns * board.rows;
  result.decoded_ratio = decoded->decoded_ratio;
  result.lit_ratio = decoded->lit_ratio;
  result.pattern_ratio = decoded->pattern_ratio;
  result.noise_counts = decoded->noise_counts;
  const int half_window =
      options.half_window > 0
          ? options.half_window
          : std::clamp(static_cast<int>(kWindowOfSpacing * median_spacing(*corners, board)),
                       kLeastHalfWindow,
                       kMostHalfWindow);
  std::int64_t lit = 0;
  std::int64_t pixels = 0;
  std::vector<double> rms;
  for (const Eigen::Vector2d& corner : *corners) {
    const LocalMapping mapping = map_to_projector(*decoded, corner, half_window);
    lit += mapping.lit;
    pixels += mapping.pixels;
    result.view.projector.push_back(
        mapping.good ? mapping.projector
                     : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
    if (!mapping.good) continue;
    ++result.corners_decoded;
    rms.push_back(mapping.rms_px);
  }
  result.corner_decoded_ratio =
      lit > 0 ? static_cast<double>(pixels) / static_cast<double>(lit) : 0;
  result.homography_rms_px = quantile(rms, 0.5);
  for (std::size_t i = 0; i < plan.patterns.size(); ++i) {
    if (result.pattern_ratio[i] < kGoodPatternRatio && !plan.patterns[i].inverse) {
      result.warnings.push_back(fmt::format(
          "pose {}: only {:.0f} % of the lit pixels tell picture {} ({}) from its inverse; if it "
          "is not simply too fine for the focus, it was shown or taken wrongly",
          name,
          100 * result.pattern_ratio[i],
          i,
          plan.patterns[i].name()));
    }
  }
  if (result.corners_decoded < result.corners) {
    result.warnings.push_back(
        fmt::format("pose {}: the projector's pixel is known for {} of {} "
                    "corners; the others are not lit or not in one plane",
                    name,
                    result.corners_decoded,
                    result.corners));
  }
  return result;
}

}  // namespace veneer::geometry
