// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "calibration/geometry/decoding.h"

namespace veneer::geometry {

/// A chessboard. Its frame: the first inner corner is the origin, x along a row of corners, y along
/// growing rows, z = 0. Every length of a result is in the unit of `square`: give metres where
/// the result goes on to a profile.
struct Board {
  int columns = 0;    ///< inner corners in a row; at least 3
  int rows = 0;       ///< likewise; at least 3
  double square = 0;  ///< side of a square; above 0

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
  /// columns * rows points, row by row.
  [[nodiscard]] std::vector<Eigen::Vector3d> corners() const;
  /// Whether the board looks the same after half a turn, so that which corner is the first may
  /// differ from view to view. It does no harm to lenses, but a tracked board must not be such:
  /// columns + rows has to be odd.
  [[nodiscard]] bool looks_same_turned() const { return (columns + rows) % 2 == 0; }
};

/// Known points of an object, and where a camera sees them and the projector lights them, at one
/// pose of the object. From a board, or from any object whose points are known (a mesh).
struct View {
  std::string name;  ///< for messages
  std::vector<Eigen::Vector3d> x_in_object;
  /// Pixels, first centre (0.5, 0.5), one a point; NaN where not seen.
  std::vector<Eigen::Vector2d> camera;
  std::vector<Eigen::Vector2d> projector;
};

/// A View of a board with what is to be said of how well it was read.
struct BoardView {
  View view;
  int corners = 0;          ///< of the board
  int corners_decoded = 0;  ///< whose projector pixel is known
  /// Of the lit pixels in the corners' windows: those that were decoded.
  double corner_decoded_ratio = 0;
  /// Deviation of the decoded pixels around a corner from its homography, projector pixels, the
  /// root mean square of the inliers; median over the corners.
  double homography_rms_px = 0;
  double decoded_ratio = 0;  ///< as of DecodedView, like the next three
  double lit_ratio = 0;
  std::vector<double> pattern_ratio;
  double noise_counts = 0;
  std::vector<std::string> warnings;
};

struct BoardOptions {
  DecodingOptions decoding;
  /// Half the side of the window around a corner whose decoded pixels make its homography, camera
  /// pixels; 0: 0.7 of the distance of neighbouring corners, up to 40.
  int half_window = 0;

  [[nodiscard]] Status check() const;
};

/// The board's inner corners in camera pixels, first centre (0.5, 0.5), in the order of
/// Board::corners(). Errors: kNotFound (no such board in the picture; the text says what to do).
[[nodiscard]] Result<std::vector<Eigen::Vector2d>> find_board(
    ImageView<const std::uint16_t> picture, const Board& board);

/// The projector pixel of a camera pixel that lies on a plane, from the decoded pixels around it: a
/// homography, found by consensus (fixed seed) and refined on its inliers.
struct LocalMapping {
  Eigen::Vector2d projector = Eigen::Vector2d::Zero();
  int pixels = 0;   ///< decoded in the window
  int lit = 0;      ///< lit in the window
  int inliers = 0;  ///< of the homography
  double rms_px = 0;
  bool good = false;  ///< enough inliers, on all sides of the pixel
};
[[nodiscard]] LocalMapping map_to_projector(const DecodedView& decoded,
                                            const Eigen::Vector2d& camera_pixel,
                                            int half_window);

/// From the pictures of a sequence to a view: decodes them, finds the board in the white one and
/// the projector pixel of each corner.
/// @param name  of the pose, for messages.
/// Errors: those of decode() and find_board(), with the name.
[[nodiscard]] Result<BoardView> observe_board(const std::string& name,
                                              std::span<const GreyPicture> pictures,
                                              const PatternPlan& plan,
                                              const Board& board,
                                              const BoardOptions& options = {});

}  // namespace veneer::geometry
