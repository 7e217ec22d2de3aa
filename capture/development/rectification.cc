// SPDX-License-Identifier: Apache-2.0
#include "capture/development/rectification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "capture/development/internal_lens.h"

namespace veneer::capture {
namespace {

constexpr double kMillimetre = 1e-3;
/// Texels with shorter sides, in pixels, are interpolated in; over longer ones pixels are averaged.
constexpr double kLeastBoxSide_px = 1.5;
/// Places along a side of a small texel at which the picture is read.
constexpr int kReads = 3;

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

/// A convex polygon in the picture: a texel, or what is left of it in a pixel.
using Polygon = std::vector<Eigen::Vector2d>;

/// What of a polygon lies where sign * (coordinate - edge) >= 0.
/// Source: Sutherland, Hodgman 1974, "Reentrant Polygon Clipping", one edge of it.
void clip(const Polygon& polygon, int axis, double edge, double sign, Polygon& clipped) {
  clipped.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d& from = polygon[i];
    const Eigen::Vector2d& to = polygon[(i + 1) % polygon.size()];
    const double before = sign * (from[axis] - edge);
    const double behind = sign * (to[axis] - edge);
    if (before >= 0) clipped.push_back(from);
    if ((before >= 0) != (behind >= 0))
      clipped.push_back(from + (to - from) * (before / (before - behind)));
  }
}

double area_of(const Polygon& polygon) {
  double twice = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d& a = polygon[i];
    const Eigen::Vector2d& b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return std::abs(0.5 * twice);
}

}  // namespace

/// Finds the pixels under a texel and what they count.
class Rectifier::Footprint {
 public:
  Footprint(const PlaneView& plane, const SampleArea& area, int width, int height)
      : projection_(plane, area), width_(width), height_(height) {}

  /// None where part of the texel lies off the picture.
  void gather(int column, int row, std::vector<Share>& shares) {
    shares.clear();
    const auto side = projection_.side_px(column, row);
    if (!side) return;
    if (*side < kLeastBoxSide_px) {
      interpolate(column, row, shares);
    } else {
      average(column, row, shares);
    }
  }

 private:
  void add(int x, int y, double weight, std::vector<Share>& shares) const {
    if (weight > 0) shares.push_back({y * width_ + x, static_cast<float>(weight)});
  }
  void interpolate(int column, int row, std::vector<Share>& shares) const {
    for (int v = 0; v < kReads; ++v) {
      for (int u = 0; u < kReads; ++u) {
        const auto pixel = projection_.pixel(column + (u + 0.5) / kReads, row + (v + 0.5) / kReads);
        // Interpolation needs the centres of four pixels around.
        if (!pixel || !(pixel->x() >= 0.5 && pixel->y() >= 0.5 && pixel->x() < width_ - 0.5 &&
                        pixel->y() < height_ - 0.5)) {
          shares.clear();
          return;
        }
        const double left = pixel->x() - 0.5;
        const double top = pixel->y() - 0.5;
        const int x = static_cast<int>(left);
        const int y = static_cast<int>(top);
        const double a = left - x;
        const double b = top - y;
        add(x, y, (1 - a) * (1 - b), shares);
        add(x + 1, y, a * (1 - b), shares);
        add(x, y + 1, (1 - a) * b, shares);
        add(x + 1, y + 1, a * b, shares);
      }
    }
    merge_equal(shares);
  }
  /// One share a pixel, so that its noise is counted once.
  static void merge_equal(std::vector<Share>& shares) {
    std::ranges::sort(shares, {}, &Share::pixel);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      if (kept > 0 && shares[kept - 1].pixel == shares[i].pixel) {
        shares[kept - 1].weight += shares[i].weight;
      } else {
        shares[kept++] = shares[i];
      }
    }
    shares.resize(kept);
  }
  /// Every pixel by the area that the texel covers of it: a pixel is the mean over its square.
  void average(int column, int row, std::vector<Share>& shares) {
    texel_.clear();
    Eigen::Vector2d least = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Vector2d most = -least;
    for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      const auto corner = projection_.pixel(column + u, row + v);
      if (!corner) return;
      texel_.push_back(*corner);
      least = least.cwiseMin(*corner);
      most = most.cwiseMax(*corner);
    }
    if (!(least.x() >= 0 && least.y() >= 0 && most.x() <= width_ && most.y() <= height_)) return;
    const int right = std::min(width_ - 1, static_cast<int>(most.x()));
    const int bottom = std::min(height_ - 1, static_cast<int>(most.y()));
    for (int y = static_cast<int>(least.y()); y <= bottom; ++y) {
      clip(texel_, 1, y, 1, half_);
      clip(half_, 1, y + 1, -1, strip_);
      for (int x = static_cast<int>(least.x()); x <= right; ++x) {
        clip(strip_, 0, x, 1, half_);
        clip(half_, 0, x + 1, -1, covered_);
        add(x, y, area_of(covered_), shares);
      }
    }
  }

  TexelProjection projection_;
  int width_;
  int height_;
  Polygon texel_, half_, strip_, covered_;
};

Rectifier::Rectifier(const PlaneView& plane, const SampleArea& area, int width, int height)
    : columns_(std::max(0, area.columns)),
      rows_(std::max(0, area.rows)),
      width_(width),
      height_(height) {
  if (columns_ == 0 || rows_ == 0) return;
  pixels_per_texel_ = TexelProjection(plane, area).side_px(0.5 * columns_, 0.5 * rows_).value_or(0);
  std::vector<std::vector<Share>> rows(static_cast<std::size_t>(rows_));
  std::vector<std::vector<std::uint32_t>> counts(static_cast<std::size_t>(rows_));
  parallel_for(rows_, 1, [&](std::int64_t begin, std::int64_t end) {
    Footprint footprint(plane, area, width, height);
    std::vector<Share> shares;
    for (auto row = static_cast<std::size_t>(begin); row < static_cast<std::size_t>(end); ++row) {
      for (int column = 0; column < columns_; ++column) {
        footprint.gather(column, static_cast<int>(row), shares);
        rows[row].insert(rows[row].end(), shares.begin(), shares.end());
        counts[row].push_back(static_cast<std::uint32_t>(shares.size()));
      }
    }
  });
  first_.push_back(0);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    for (const std::uint32_t count : counts[row]) first_.push_back(first_.back() + count);
    shares_.insert(shares_.end(), rows[row].begin(), rows[row].end());
  }
}

RectifiedPicture Rectifier::rectify(const MergedPicture& picture) const {
  VENEER_CHECK(picture.light.width() == width_ && picture.light.height() == height_);
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  RectifiedPicture rectified;
  rectified.light = Image<Rgb32f>(columns_, rows_);
  rectified.variance = Image<Rgb32f>(columns_, rows_, Rgb32f::Constant(kInfinite));
  rectified.masked = Image<std::uint8_t>(columns_, rows_, 1);
  rectified.pixels_per_texel = pixels_per_texel_;
  const auto light = picture.light.pixels();
  const auto noise = picture.variance.pixels();
  const auto saturated = picture.saturated.pixels();
  for (std::size_t texel = 0; texel + 1 < first_.size(); ++texel) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d variance = Eigen::Vector3d::Zero();
    double total = 0;
    bool good = true;
    for (std::size_t i = first_[texel]; i < first_[texel + 1]; ++i) {
      const Share& share = shares_[i];
      const auto pixel = static_cast<std::size_t>(share.pixel);
      good = good && saturated[pixel] == 0 && light[pixel].allFinite() && noise[pixel].allFinite();
      const double weight = share.weight;
      total += weight;
      sum += weight * light[pixel].cast<double>();
      variance += weight * weight * noise[pixel].cast<double>();
    }
    if (!good || !(total > 0)) continue;
    rectified.light.pixels()[texel] = (sum / total).cast<float>();
    rectified.variance.pixels()[texel] = (variance / (total * total)).cast<float>();
    rectified.masked.pixels()[texel] = 0;
  }
  return rectified;
}

RectifiedPicture rectify(const MergedPicture& picture,
                         const PlaneView& plane,
                         const SampleArea& area) {
  return Rectifier(plane, area, picture.light.width(), picture.light.height()).rectify(picture);
}

}  // namespace veneer::capture
