// SPDX-License-Identifier: Apache-2.0
#include "capture/development/mirror_ball.h"

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "base/statistics.h"
#include "capture/development/internal_lens.h"
#include "capture/development/internal_opencv.h"

namespace veneer::capture {
namespace {

constexpr double kMillimetre = 1e-3;
constexpr double kLeastHighlight = 20;  // brighter than the median of the picture
constexpr double kOfHighlight = 0.1;    // of its brightest: what belongs to it
constexpr int kOutlinePoints = 180;     // at which the outline is looked at
constexpr double kAcrossPx = 1;         // half the way across the outline
constexpr double kMostContrast = 0.5;   // of logarithms: one strong edge is not an outline
/// A ball's outline stands out by so much over what chance makes elsewhere.
constexpr double kLeastStandingOut = 1.4;
constexpr double kLeastOutline = 0.15;  // a steel ball on the board has 0.35 and more
constexpr double kLeastRadiusPx = 8;
constexpr int kRimReach = 6;  // half pixels around the outline that was found
constexpr double kSettledPx = 0.01;
constexpr double kReadingErrorPx = 0.5;
/// Below this likeness the rim does not mirror the board, and the outline alone is to be had, with
/// this error.
constexpr double kLeastLikeness = 0.2;
constexpr double kOutlineErrorPx = 1.5;

/// Where a ball of which the place on the board is known shows in the picture.
class BallView {
 public:
  BallView(const PlaneView& plane, double radius_m) : plane_(plane), radius_(radius_m) {}

  /// Camera frame; it touches the board.
  [[nodiscard]] Eigen::Vector3d centre(const Eigen::Vector2d& place_m) const {
    return plane_.camera_from_board * Eigen::Vector3d(place_m.x(), place_m.y(), -radius_);
  }
  [[nodiscard]] std::optional<Eigen::Vector2d> centre_px(const Eigen::Vector2d& place_m) const {
    return project(plane_.lens, centre(place_m));
  }
  /// A point of the outline, or of one that is `growth` times as large: the circle where rays from
  /// the camera touch the ball.
  [[nodiscard]] std::optional<Eigen::Vector2d> outline_px(const Eigen::Vector2d& place_m,
                                                          double turn_rad,
                                                          double growth) const {
    const Eigen::Vector3d middle = centre(place_m);
    const double ratio = radius_ * radius_ / middle.squaredNorm();
    if (!(ratio < 1)) return std::nullopt;
    const Eigen::Vector3d along = middle.normalized();
    const Eigen::Vector3d right = along.unitOrthogonal();
    const Eigen::Vector3d up = along.cross(right);
    const double circle = radius_ * std::sqrt(1 - ratio) * growth;
    return project(
        plane_.lens,
        (1 - ratio) * middle + circle * (std::cos(turn_rad) * right + std::sin(turn_rad) * up));
  }
  /// Where the light comes from that is mirrored at a pixel; board frame. Nothing beside the ball.
  [[nodiscard]] std::optional<Eigen::Vector3d> light_at(const Eigen::Vector2d& place_m,
                                                        const Eigen::Vector2d& pixel) const {
    const auto ray = ray_through(plane_.lens, pixel);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d middle = centre(place_m);
    const double nearest = ray->dot(middle);
    const double root2 = nearest * nearest - middle.squaredNorm() + radius_ * radius_;
    if (!(root2 > 0)) return std::nullopt;
    const Eigen::Vector3d normal = ((nearest - std::sqrt(root2)) * *ray - middle) / radius_;
    const Eigen::Vector3d mirrored = *ray - 2 * ray->dot(normal) * normal;
    return plane_.camera_from_board.rotation.conjugate() * mirrored;
  }
  /// Where in the picture that place of the board is which is mirrored at a pixel of the ball.
  [[nodiscard]] std::optional<Eigen::Vector2d> mirrored_px(const Eigen::Vector2d& place_m,
                                                           const Eigen::Vector2d& pixel) const {
    const auto ray = ray_through(plane_.lens, pixel);
    const auto direction = light_at(place_m, pixel);
    if (!ray || !direction || !(direction->z() > 0)) return std::nullopt;
    const Eigen::Vector3d middle = centre(place_m);
    const double nearest = ray->dot(middle);
    const double root2 = nearest * nearest - middle.squaredNorm() + radius_ * radius_;
    const Eigen::Vector3d point =
        plane_.camera_from_board.inverse() * ((nearest - std::sqrt(root2)) * *ray);
    const Eigen::Vector3d hit = point - point.z() / direction->z() * *direction;
    return project(plane_.lens, plane_.camera_from_board * hit);
  }
  /// The place on the board at which a ball's centre shows in this pixel.
  [[nodiscard]] std::optional<Eigen::Vector2d> place_under(const Eigen::Vector2d& pixel) const {
    const auto ray = ray_through(plane_.lens, pixel);
    if (!ray) return std::nullopt;
    const RigidTransform board_from_camera = plane_.camera_from_board.inverse();
    const Eigen::Vector3d direction = board_from_camera.rotation * *ray;
    const double way = (-radius_ - board_from_camera.translation.z()) / direction.z();
    if (!(way > 0) || !std::isfinite(way)) return std::nullopt;
    return Eigen::Vector2d((board_from_camera.translation + way * direction).head<2>());
  }

 private:
  const PlaneView& plane_;
  double radius_;
};

double read(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  const double x = pixel.x() - kPixelCentre;
  const double y = pixel.y() - kPixelCentre;
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const double a = x - left;
  const double b = y - top;
  return (1 - b) * ((1 - a) * image.at<float>(top, left) + a * image.at<float>(top, left + 1)) +
         b * ((1 - a) * image.at<float>(top + 1, left) + a * image.at<float>(top + 1, left + 1));
}

/// How much of an outline a place has: mean change of the light's logarithm across it. 0 where it
/// leaves the picture.
double outline_strength(const cv::Mat& logarithm,
                        const BallView& ball,
                        const Eigen::Vector2d& place_m,
                        double radius_px,
                        double growth = 1) {
  double sum = 0;
  for (int i = 0; i < kOutlinePoints; ++i) {
    const double turn = 2 * std::numbers::pi * i / kOutlinePoints;
    double across[2];
    for (const int side : {0, 1}) {
      const auto pixel =
          ball.outline_px(place_m, turn, growth + (2 * side - 1) * kAcrossPx / radius_px);
      if (!pixel || !(pixel->x() >= 1 && pixel->y() >= 1 && pixel->x() < logarithm.cols - 1 &&
                      pixel->y() < logarithm.rows - 1))
        return 0;
      across[side] = read(logarithm, *pixel);
    }
    sum += std::min(kMostContrast, std::abs(across[1] - across[0]));
  }
  return sum / kOutlinePoints;
}

/// That of the outline less that of rings inside, where a ball mirrors the room and not the marks.
double ball_likeness(const cv::Mat& logarithm,
                     const BallView& ball,
                     const Eigen::Vector2d& place_m,
                     double radius_px) {
  const double outline = outline_strength(logarithm, ball, place_m, radius_px);
  if (outline == 0) return 0;
  double inside = 0;
  for (const double growth : {0.3, 0.5, 0.65})
    inside += outline_strength(logarithm, ball, place_m, radius_px, growth) / 3;
  return outline - inside;
}

/// A ball mirrors the board around it in its rim: correlation of the rim's light with that of the
/// places which are mirrored there, as the same picture shows them. The board is matt, so that it
/// looks to the ball as to the camera.
double mirror_likeness(const cv::Mat& logarithm,
                       const BallView& ball,
                       const Eigen::Vector2d& place_m) {
  double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  for (double growth = 0.76; growth < 0.97; growth += 0.02) {
    for (int i = 0; i < 2 * kOutlinePoints; ++i) {
      const auto rim = ball.outline_px(place_m, std::numbers::pi * i / kOutlinePoints, growth);
      const auto board = rim ? ball.mirrored_px(place_m, *rim) : std::nullopt;
      if (!board) continue;
      bool inside = true;
      for (const Eigen::Vector2d& pixel : {*rim, *board})
        inside = inside && pixel.x() >= 1 && pixel.y() >= 1 && pixel.x() < logarithm.cols - 1 &&
                 pixel.y() < logarithm.rows - 1;
      if (!inside) continue;
      const double own = read(logarithm, *rim);
      const double wanted = read(logarithm, *board);
      n += 1;
      a += own;
      b += wanted;
      aa += own * own;
      ab += own * wanted;
      bb += wanted * wanted;
    }
  }
  const double spread = (n * aa - a * a) * (n * bb - b * b);
  return n >= kOutlinePoints && spread > 0 ? (n * ab - a * b) / std::sqrt(spread) : 0;
}

/// Mean of the channels; a saturated pixel is brighter than all that are not.
cv::Mat brightness(const MergedPicture& picture) {
  cv::Mat grey(picture.light.height(), picture.light.width(), CV_32F);
  float most = 0;
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const float mean = picture.light(x, y).mean();
      grey.at<float>(y, x) = std::isfinite(mean) && mean > 0 ? mean : 0.0F;
      if (picture.saturated(x, y) == 0) most = std::max(most, grey.at<float>(y, x));
    }
  }
  for (int y = 0; y < grey.rows; ++y)
    for (int x = 0; x < grey.cols; ++x)
      if (picture.saturated(x, y) != 0) grey.at<float>(y, x) = 4 * most;
  return grey;
}

/// Centroid of the brightest spot; nothing where none stands out.
std::optional<Eigen::Vector2d> highlight_of(const cv::Mat& grey, double median) {
  cv::Mat spread;  // a hot pixel is no highlight
  cv::GaussianBlur(grey, spread, {}, 1.2);
  double most = 0;
  cv::Point brightest;
  cv::minMaxLoc(spread, nullptr, &most, nullptr, &brightest);
  if (!(most > kLeastHighlight * median) || !(most > 0)) return std::nullopt;
  cv::Mat labels;
  cv::connectedComponents(spread > kOfHighlight * most, labels, 8, CV_32S);
  const int own = labels.at<int>(brightest);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      if (labels.at<int>(y, x) != own) continue;
      sum += (spread.at<float>(y, x) - kOfHighlight * most) *
             Eigen::Vector3d(x + kPixelCentre, y + kPixelCentre, 1);
    }
  }
  return Eigen::Vector2d(sum.head<2>() / sum.z());
}

Result<BallReading> search(const MergedPicture& picture, const PlaneView& plane, double radius_m) {
  const cv::Mat grey = brightness(picture);
  std::vector<double> values(grey.begin<float>(), grey.end<float>());
  const double median = quantile(std::move(values), 0.5);
  const auto highlight = highlight_of(grey, median);
  const BallView ball(plane, radius_m);
  const auto start = highlight ? ball.place_under(*highlight) : std::nullopt;
  if (!start) {
    return fail(Errc::kNotFound,
                "reading the mirror ball: no spot is {} times as bright as the picture; check that "
                "the light falls on the ball and that the longest exposures are short enough",
                kLeastHighlight);
  }
  // How large the ball is, and how far a pixel is on the board.
  const auto middle_px = ball.centre_px(*start);
  double radius_px = 0;
  for (int i = 0; i < 4 && middle_px; ++i)
    if (const auto rim = ball.outline_px(*start, i * std::numbers::pi / 2, 1))
      radius_px = std::max(radius_px, (*rim - *middle_px).norm());
  if (!(radius_px >= kLeastRadiusPx)) {
    return fail(Errc::kNotFound,
                "reading the mirror ball: it would show with a radius of {:.1f} px, {} are needed; "
                "check ball_radius_mm and the lens",
                radius_px,
                kLeastRadiusPx);
  }
  cv::Mat logarithm = grey + (0.05 * median + 1e-30);
  cv::log(logarithm, logarithm);
  cv::Mat smooth;
  cv::GaussianBlur(logarithm, smooth, {}, 0.7);

  // The highlight is on the ball: every place within its radius is tried, pixel by pixel.
  const double pixel_m = radius_m / radius_px;
  const int reach = static_cast<int>(std::ceil(radius_px));
  Eigen::Vector2d best = *start;
  double strongest = 0;
  std::vector<double> strengths;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const Eigen::Vector2d place = *start + pixel_m * Eigen::Vector2d(x, y);
      if (!ball.light_at(place, *highlight)) continue;
      const double strength = ball_likeness(smooth, ball, place, radius_px);
      if (strength == 0) continue;
      strengths.push_back(strength);
      if (strength > strongest) {
        strongest = strength;
        best = place;
      }
    }
  }
  if (!(strongest > std::max(kLeastOutline, kLeastStandingOut * quantile(strengths, 0.5)))) {
    return fail(Errc::kNotFound,
                "reading the mirror ball: there is a bright spot at {:.0f}, {:.0f} but no outline "
                "of a ball of {} mm around it; check that the ball lies on the board, whole in the "
                "picture and sharp, and ball_radius_mm",
                highlight->x(),
                highlight->y(),
                radius_m / kMillimetre);
  }
  // The outline is found to a pixel or two; what the rim mirrors places it far better.
  const Eigen::Vector2d found = best;
  double likeness = 0;
  for (int y = -kRimReach; y <= kRimReach; ++y) {
    for (int x = -kRimReach; x <= kRimReach; ++x) {
      const Eigen::Vector2d place = found + 0.5 * pixel_m * Eigen::Vector2d(x, y);
      const double own = mirror_likeness(smooth, ball, place);
      if (own <= likeness) continue;
      likeness = own;
      best = place;
    }
  }
  for (double step = 0.25 * pixel_m; step > kSettledPx * pixel_m;) {
    bool moved = false;
    for (const auto& [x, y] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const Eigen::Vector2d place = best + step * Eigen::Vector2d(x, y);
      const double own = mirror_likeness(smooth, ball, place);
      if (!(own > likeness)) continue;
      likeness = own;
      best = place;
      moved = true;
    }
    if (!moved) step /= 2;
  }

  if (likeness < kLeastLikeness) best = found;
  const double error_px = likeness < kLeastLikeness ? kOutlineErrorPx : kReadingErrorPx;

  const auto light = ball.light_at(best, *highlight);
  const auto centre = ball.centre_px(best);
  if (!light || !centre) {
    return fail(Errc::kNotFound,
                "reading the mirror ball: the bright spot at {:.0f}, {:.0f} is not on the ball; "
                "take away what else shines, or cover it",
                highlight->x(),
                highlight->y());
  }
  BallReading reading;
  reading.light = Eigen::Vector3d(light->x(), -light->y(), -light->z()).normalized();
  reading.centre_px = *centre;
  reading.radius_px = radius_px;
  reading.highlight_px = *highlight;
  double squares = 0;
  for (const auto& [x, y] : {std::array{1.0, 0.0}, {0.0, 1.0}}) {
    const Eigen::Vector2d off = error_px * Eigen::Vector2d(x, y);
    for (const auto& moved :
         {ball.light_at(best + pixel_m * off, *highlight), ball.light_at(best, *highlight + off)}) {
      const double angle = moved ? std::atan2(moved->cross(*light).norm(), moved->dot(*light))
                                 : std::numbers::pi / 2;
      squares += angle * angle;
    }
  }
  reading.deviation_rad = std::sqrt(squares);
  return reading;
}

}  // namespace

Result<BallReading> read_mirror_ball(const MergedPicture& picture,
                                     const PlaneView& plane,
                                     double ball_radius_mm) {
  VENEER_TRY(check_lens(plane.lens));
  if (!(ball_radius_mm > 0) || !std::isfinite(ball_radius_mm)) {
    return fail(Errc::kNotFound,
                "reading the mirror ball: ball_radius_mm is {}; give one above 0",
                ball_radius_mm);
  }
  if (picture.light.empty())
    return fail(Errc::kNotFound, "reading the mirror ball: the picture is empty; take it again");
  try {
    return search(picture, plane, ball_radius_mm * kMillimetre);
  } catch (const cv::Exception& error) {
    return fail(Errc::kNotFound, "reading the mirror ball: OpenCV says {}", error.what());
  }
}

}  // namespace veneer::capture
