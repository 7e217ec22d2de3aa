// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "capture/development/hdr_merge.h"
#include "capture/plan.h"

namespace veneer::capture {

/// The board as it is to be printed, `pixels_per_mm` fine; white 255. Errors: kInvalidOption.
[[nodiscard]] Result<Image<std::uint8_t>> draw_board(const MarkBoard& board, double pixels_per_mm);

/// The board's inner corners that a picture shows.
struct FoundMarks {
  std::vector<int> ids;                   ///< of the corners
  std::vector<Eigen::Vector2d> pixels;    ///< first centre (0.5, 0.5)
  std::vector<Eigen::Vector2d> board_mm;  ///< where they are on the board
};
/// @param picture  linear light; it is stretched and encoded for the search.
/// Errors: kNotFound (fewer than 6 corners, or all on a line: the text says what to do).
[[nodiscard]] Result<FoundMarks> find_marks(const Image<Rgb32f>& picture, const MarkBoard& board);

/// Where the board's plane is in a picture.
struct PlaneView {
  CameraLens lens;
  RigidTransform camera_from_board;  ///< metres; board z into the board, away from the camera
  double rms_px = 0;                 ///< of the corners
  double worst_px = 0;
  /// From the middle of the sample to the camera, local frame.
  Eigen::Vector3d view_direction = Eigen::Vector3d::UnitZ();
  /// Greatest angle between that and the direction from any other place of the sample.
  double view_spread_rad = 0;
};
/// Lens from several views of the board (with one view, focal lengths only from a tilted one).
/// Errors: kNotFound, kBadFormat (a fit that does not converge; residual above 2 px).
[[nodiscard]] Result<CameraLens> calibrate_lens(const std::vector<FoundMarks>& views,
                                                int width,
                                                int height);
/// A few corners (a fifth at most) that are off by far more than the rest are left out.
/// Errors: kInvalidOption (a lens without finite values), kBadFormat (fewer than 6 corners,
/// residual above 2 px: a wrong board or lens; the text says which values it has).
[[nodiscard]] Result<PlaneView> locate_plane(const FoundMarks& marks,
                                             const CameraLens& lens,
                                             const SampleArea& area);

/// Light of the sample's texels.
struct RectifiedPicture {
  Image<Rgb32f> light;  ///< [rows x columns of SampleArea]
  /// Of it; that neighbouring texels share pixels is not said.
  Image<Rgb32f> variance;
  /// 1, its light 0 and its variance infinite, where a pixel that the texel covers was saturated or
  /// lies off the picture.
  Image<std::uint8_t> masked;
  double pixels_per_texel =
      0;  ///< along a side, in the middle; below 1 texels are finer than pixels
};
/// From pictures to texels through one plane, for as many pictures as one likes. A texel longer
/// than 1.5 pixels is the mean of the pixels that it covers, each by the area; a shorter one is
/// interpolated in. Thread-safe after construction.
class Rectifier {
 public:
  /// @param width, height  of the pictures.
  Rectifier(const PlaneView& plane, const SampleArea& area, int width, int height);
  [[nodiscard]] RectifiedPicture rectify(const MergedPicture& picture) const;

 private:
  class Footprint;
  struct Share {
    std::int32_t pixel = 0;  // row * width + column
    float weight = 0;
  };
  int columns_ = 0, rows_ = 0;
  int width_ = 0, height_ = 0;
  double pixels_per_texel_ = 0;
  // Shares of texel i: [first_[i], first_[i + 1]) of shares_; none where it lies off the picture.
  std::vector<std::size_t> first_;
  std::vector<Share> shares_;
};

/// The same for a single picture.
[[nodiscard]] RectifiedPicture rectify(const MergedPicture& picture,
                                       const PlaneView& plane,
                                       const SampleArea& area);

}  // namespace veneer::capture
