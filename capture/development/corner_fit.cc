// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "capture/development/internal_corner_fit.h"

namespace veneer::capture {
namespace {

constexpr int kMostReachPx = 16;  // more pixels do not place a corner better than its noise
constexpr int kRounds = 6;
constexpr int kSamples = 4;      // of the drawing in a pixel, along a side
constexpr double kBlurPx = 0.5;  // of a sharp lens; edges blur to both sides, so it matters little
constexpr double kMostMovePx = 4;  // from the first guess
/// A pixel that is off by this part of the step from black to white counts for half.
constexpr double kHalfOff = 0.2;
constexpr double kSettledPx = 2e-3;

/// The drawing as the picture should show it, white 1, on whole pixels [0, width) x [0, height)
/// from `left`, `top`, and a pixel more around for its slopes.
class DrawnPatch {
 public:
  DrawnPatch(const BoardLayout& layout,
             const Eigen::Matrix3d& mm_from_pixel,
             int left,
             int top,
             int width,
             int height)
      : width_(width + 2 * kRim), values_(static_cast<std::size_t>(width_ * (height + 2 * kRim))) {
    const int rows = height + 2 * kRim;
    std::vector<double> sharp(values_.size());
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < width_; ++x) {
        int white = 0;
        for (int i = 0; i < kSamples * kSamples; ++i) {
          const Eigen::Vector3d place =
              mm_from_pixel * Eigen::Vector3d(left + x - kRim + (i % kSamples + 0.5) / kSamples,
                                              top + y - kRim + (i / kSamples + 0.5) / kSamples,
                                              1);
          white += layout.black(place.head<2>() / place.z()) ? 0 : 1;
        }
        sharp[index(x, y)] = static_cast<double>(white) / (kSamples * kSamples);
      }
    }
    blur(sharp, rows);
  }
  [[nodiscard]] double value(int x, int y) const { return values_[index(x + kRim, y + kRim)]; }
  [[nodiscard]] Eigen::Vector2d slope(int x, int y) const {
    return {(value(x + 1, y) - value(x - 1, y)) / 2, (value(x, y + 1) - value(x, y - 1)) / 2};
  }

 private:
  static constexpr int kRim = 3;
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y * width_ + x);
  }
  /// Values within two pixels of the rim stay as they are; they are never asked for.
  void blur(const std::vector<double>& sharp, int rows) {
    std::array<double, 5> kernel{};
    double total = 0;
    for (int i = -2; i <= 2; ++i)
      total += kernel[static_cast<std::size_t>(i + 2)] =
          std::exp(-0.5 * i * i / (kBlurPx * kBlurPx));
    std::vector<double> half = sharp;
    for (int y = 0; y < rows; ++y)
      for (int x = 2; x + 2 < width_; ++x) {
        double sum = 0;
        for (int i = -2; i <= 2; ++i)
          sum += kernel[static_cast<std::size_t>(i + 2)] * sharp[index(x + i, y)];
        half[index(x, y)] = sum / total;
      }
    values_ = half;
    for (int y = 2; y + 2 < rows; ++y)
      for (int x = 0; x < width_; ++x) {
        double sum = 0;
        for (int i = -2; i <= 2; ++i)
          sum += kernel[static_cast<std::size_t>(i + 2)] * half[index(x, y + i)];
        values_[index(x, y)] = sum / total;
      }
  }

  int width_;
  std::vector<double> values_;
};

/// Of two quantities, weighted.
class Correlation {
 public:
  void add(double a, double b, double weight) {
    w_ += weight;
    a_ += weight * a;
    b_ += weight * b;
    aa_ += weight * a * a;
    ab_ += weight * a * b;
    bb_ += weight * b * b;
  }
  /// 0 where one of them is constant.
  [[nodiscard]] double value() const {
    const double spread_a = w_ * aa_ - a_ * a_;
    const double spread_b = w_ * bb_ - b_ * b_;
    return spread_a > 0 && spread_b > 0
               ? (w_ * ab_ - a_ * b_) / (std::sqrt(spread_a) * std::sqrt(spread_b))
               : 0;
  }

 private:
  double w_ = 0, a_ = 0, b_ = 0, aa_ = 0, ab_ = 0, bb_ = 0;
};

Eigen::Vector2d apply(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

}  // namespace

std::optional<CornerFit> fit_corner(const cv::Mat& grey,
                                    const BoardLayout& layout,
                                    const Eigen::Matrix3d& pixel_from_mm,
                                    const Eigen::Vector2d& corner_mm,
                                    double reach_mm) {
  const Eigen::Matrix3d mm_from_guess = pixel_from_mm.inverse();
  const Eigen::Vector2d guess = apply(pixel_from_mm, corner_mm);
  if (!mm_from_guess.allFinite() || !guess.allFinite()) return std::nullopt;
  double reach_px = 0;
  for (const auto& [x, y] : {std::array{1, 1}, {1, -1}, {-1, 1}, {-1, -1}}) {
    const Eigen::Vector2d off =
        apply(pixel_from_mm, corner_mm + reach_mm * Eigen::Vector2d(x, y)) - guess;
    reach_px = std::max(reach_px, off.lpNorm<Eigen::Infinity>());
  }
  const int reach = std::min(kMostReachPx, static_cast<int>(std::ceil(reach_px)));
  const int left = static_cast<int>(std::floor(guess.x())) - reach;
  const int top = static_cast<int>(std::floor(guess.y())) - reach;
  const int side = 2 * reach + 1;
  if (!(left >= 0 && top >= 0 && left + side <= grey.cols && top + side <= grey.rows))
    return std::nullopt;

  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  Eigen::Vector4d solved = Eigen::Vector4d::Zero();  // offset, gain, gain times how far to move
  CornerFit fit;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d guess_from_pixel = Eigen::Matrix3d::Identity();
    guess_from_pixel.topRightCorner<2, 1>() = -shift;
    const Eigen::Matrix3d mm_from_pixel = mm_from_guess * guess_from_pixel;
    const DrawnPatch drawn(layout, mm_from_pixel, left, top, side, side);
    // light = offset + gain drawn + moves . slope, by least squares, robustly from the second round
    // on: the sample's edge or a glint may reach in.
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    Correlation likeness;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const Eigen::Vector2d place =
            apply(mm_from_pixel, Eigen::Vector2d(left + x + 0.5, top + y + 0.5)) - corner_mm;
        const double off = place.lpNorm<Eigen::Infinity>() / reach_mm;
        if (!(off < 1)) continue;
        const Eigen::Vector2d slope = drawn.slope(x, y);
        const double light = grey.at<float>(top + y, left + x);
        double weight = 1 - off * off;
        likeness.add(drawn.value(x, y), light, weight);
        if (solved[1] > 0) {
          const double miss =
              (light - solved[0] - solved[1] * drawn.value(x, y)) / (kHalfOff * solved[1]);
          weight /= 1 + miss * miss;
        }
        const Eigen::Vector4d row(1, drawn.value(x, y), slope.x(), slope.y());
        normal += weight * row * row.transpose();
        right += weight * light * row;
      }
    }
    fit.likeness = likeness.value();
    solved = normal.ldlt().solve(right);
    if (!solved.allFinite() || !(solved[1] > 0)) return std::nullopt;
    // A drawing moved by s is drawn - s . slope.
    Eigen::Vector2d step = -solved.segment<2>(2) / solved[1];
    if (step.norm() > 1) step.normalize();
    shift += step;
    if (!(shift.norm() <= kMostMovePx)) return std::nullopt;
    if (step.norm() < kSettledPx) break;
  }
  fit.pixel = guess + shift;
  return fit;
}

}  // namespace veneer::capture
