// SPDX-License-Identifier: Apache-2.0
#include "capture/development/rectification.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "capture/development/internal_lens.h"

namespace veneer::capture {
namespace {

constexpr double kMillimetre = 1e-3;
/// Places along a side of a texel at which the picture is read, for each pixel that the side is
/// long: what lies between two of them is seen by both through the interpolation.
constexpr double kReadsPerPixel = 2;
constexpr int kMostReads = 64;

/// Where places of the sample are in the picture. u, v in texels.
class TexelProjection {
 public:
  TexelProjection(const PlaneView& plane, const SampleArea& area)
      : lens_(plane.lens), pose_(plane.camera_from_board), area_(area) {}
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel(double u, double v) const {
    const Eigen::Vector3d place(area_.left_mm + u / area_.columns * area_.width_mm,
                                area_.top_mm + v / area_.rows * area_.height_mm,
                                -area_.lift_mm);
    return project(lens_, pose_ * (place * kMillimetre));
  }
  /// Longer of a texel's sides in the picture; nothing where a corner is out of the lens's reach.
  [[nodiscard]] std::optional<double> side_px(double u, double v) const {
    const auto here = pixel(u, v);
    const auto right = pixel(u + 1, v);
    const auto below = pixel(u, v + 1);
    if (!here || !right || !below) return std::nullopt;
    return std::max((*right - *here).norm(), (*below - *here).norm());
  }

 private:
  CameraLens lens_;
  RigidTransform pose_;
  SampleArea area_;
};

/// Weights of the pixels under one texel.
class Footprint {
 public:
  /// False where part of it lies off the picture.
  [[nodiscard]] bool gather(
      const TexelProjection& projection, int column, int row, int width, int height) {
    weights_.clear();
    places_.clear();
    const auto side = projection.side_px(column, row);
    if (!side) return false;
    const int reads =
        std::clamp(static_cast<int>(std::ceil(kReadsPerPixel * *side)), 1, kMostReads);
    int left = width;
    int right = -1;
    int top = height;
    int bottom = -1;
    for (int y = 0; y < reads; ++y) {
      for (int x = 0; x < reads; ++x) {
        const auto pixel = projection.pixel(column + (x + 0.5) / reads, row + (y + 0.5) / reads);
        // Interpolation needs the centres of four pixels around.
        if (!pixel || !(pixel->x() >= 0.5 && pixel->y() >= 0.5 && pixel->x() <= width - 0.5 &&
                        pixel->y() <= height - 0.5))
          return false;
        const Eigen::Vector2d place = *pixel - Eigen::Vector2d::Constant(0.5);
        places_.push_back(place);
        left = std::min(left, static_cast<int>(place.x()));
        right = std::max(right, static_cast<int>(place.x()) + 1);
        top = std::min(top, static_cast<int>(place.y()));
        bottom = std::max(bottom, static_cast<int>(place.y()) + 1);
      }
    }
    left_ = left;
    top_ = top;
    columns_ = right - left + 1;
    weights_.assign(static_cast<std::size_t>(columns_ * (bottom - top + 1)), 0.0);
    const double share = 1.0 / static_cast<double>(places_.size());
    for (const Eigen::Vector2d& place : places_) {
      const int x = static_cast<int>(place.x());
      const int y = static_cast<int>(place.y());
      const double a = place.x() - x;
      const double b = place.y() - y;
      const auto first = static_cast<std::size_t>((y - top_) * columns_ + (x - left_));
      const auto below = first + static_cast<std::size_t>(columns_);
      weights_[first] += share * (1 - a) * (1 - b);
      weights_[first + 1] += share * a * (1 - b);
      weights_[below] += share * (1 - a) * b;
      weights_[below + 1] += share * a * b;
    }
    return true;
  }
  /// Calls `body(x, y, weight)` for the pixels that count.
  template <class Body>
  void for_each(const Body& body) const {
    for (std::size_t i = 0; i < weights_.size(); ++i) {
      if (weights_[i] > 0)
        body(left_ + static_cast<int>(i) % columns_,
             top_ + static_cast<int>(i) / columns_,
             weights_[i]);
    }
  }

 private:
  int left_ = 0;
  int top_ = 0;
  int columns_ = 0;
  std::vector<double> weights_;
  std::vector<Eigen::Vector2d> places_;
};

}  // namespace

RectifiedPicture rectify(const MergedPicture& picture,
                         const PlaneView& plane,
                         const SampleArea& area) {
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  RectifiedPicture rectified;
  if (area.columns < 1 || area.rows < 1) return rectified;
  rectified.light = Image<Rgb32f>(area.columns, area.rows);
  rectified.variance = Image<Rgb32f>(area.columns, area.rows, Rgb32f::Constant(kInfinite));
  rectified.masked = Image<std::uint8_t>(area.columns, area.rows, 1);
  const TexelProjection projection(plane, area);
  rectified.pixels_per_texel = projection.side_px(0.5 * area.columns, 0.5 * area.rows).value_or(0);

  parallel_for(area.rows, 1, [&](std::int64_t begin, std::int64_t end) {
    Footprint footprint;
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < area.columns; ++column) {
        if (!footprint.gather(
                projection, column, row, picture.light.width(), picture.light.height()))
          continue;
        Eigen::Vector3d light = Eigen::Vector3d::Zero();
        Eigen::Vector3d variance = Eigen::Vector3d::Zero();
        double total = 0;
        bool good = true;
        footprint.for_each([&](int x, int y, double weight) {
          const Rgb32f& value = picture.light(x, y);
          const Rgb32f& noise = picture.variance(x, y);
          good = good && picture.saturated(x, y) == 0 && value.allFinite() && noise.allFinite();
          light += weight * value.cast<double>();
          variance += weight * weight * noise.cast<double>();
          total += weight;
        });
        if (!good) continue;
        rectified.light(column, row) = (light / total).cast<float>();
        rectified.variance(column, row) = (variance / (total * total)).cast<float>();
        rectified.masked(column, row) = 0;
      }
    }
  });
  return rectified;
}

}  // namespace veneer::capture
