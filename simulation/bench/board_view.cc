// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/board_view.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "base/random.h"
#include "base/units.h"

namespace veneer::simulation {
namespace {

constexpr int kTableSteps = 4096;

double distortion(double k1, double k2, double squared) {
  return 1.0 + squared * (k1 + squared * k2);
}

/// The largest slope in a camera's picture, were there no distortion.
double most_slope(const CameraTruth& camera) {
  return Eigen::Vector2d(camera.width, camera.height).norm() / camera.focal_px;
}

/// 1 from an even to the next odd number and -1 from there on, averaged over a box about `x`.
double square_wave(double x, double width) {
  const auto phase = [](double at) { return at - 2 * std::floor(0.5 * at); };  // in [0, 2)
  if (!(width > 0)) return phase(x) < 1 ? 1 : -1;
  const auto integral = [&phase](double at) { return 1 - std::abs(1 - phase(at)); };
  return (integral(x + 0.5 * width) - integral(x - 0.5 * width)) / width;
}

/// Half the sides of a board with its border, and its middle.
std::pair<Eigen::Vector2d, Eigen::Vector2d> extent(const BoardTruth& board) {
  const Eigen::Vector2d squares(board.columns + 1, board.rows + 1);
  const Eigen::Vector2d inner(board.columns - 1, board.rows - 1);
  return {0.5 * board.square_m * squares + Eigen::Vector2d::Constant(board.border_m),
          0.5 * board.square_m * inner};
}

/// What both devices must see of a board in a pose: its four corners, with a margin.
bool fits(const BoardTruth& board,
          const CameraTruth& camera,
          const ProjectorTruth& projector,
          const RigidTransform& world_from_board) {
  constexpr double kMargin = 0.02;  // of a picture's side
  const auto within = [](const Eigen::Vector2d& pixel, double width, double height) {
    const Eigen::Vector2d part(pixel.x() / width, pixel.y() / height);
    return part.minCoeff() >= kMargin && part.maxCoeff() <= 1 - kMargin;
  };
  const RigidTransform board_from_world = world_from_board.inverse();
  const RigidTransform projector_from_world = projector.world_from_projector.inverse();
  const RigidTransform camera_from_world = camera.world_from_camera.inverse();
  for (const RigidTransform* device : {&projector.world_from_projector, &camera.world_from_camera})
    if (!((board_from_world * device->translation).z() < 0)) return false;
  const auto [half, middle] = extent(board);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector2d corner = middle + Eigen::Vector2d(sx * half.x(), sy * half.y());
      const Eigen::Vector3d x_in_world =
          world_from_board * Eigen::Vector3d(corner.x(), corner.y(), 0);
      const Eigen::Vector3d x_in_projector = projector_from_world * x_in_world;
      const Eigen::Vector3d x_in_camera = camera_from_world * x_in_world;
      if (!(x_in_projector.z() > 0) || !(x_in_camera.z() > 0)) return false;
      const Eigen::Vector2d raster =
          projector.focal_px.cwiseProduct(x_in_projector.head<2>() / x_in_projector.z()) +
          projector.principal_point;
      if (!within(raster, projector.width, projector.height)) return false;
      if (!within(camera_pixel(camera, x_in_world), camera.width, camera.height)) return false;
    }
  return true;
}

}  // namespace

RadialDistortion::RadialDistortion(double k1, double k2, double most_slope)
    : k1_(k1),
      k2_(k2),
      most_squared_(std::pow(most_slope * distortion(k1, k2, most_slope * most_slope), 2)) {
  for (int i = 0; i <= kTableSteps; ++i) {
    const double radius = std::sqrt(most_squared_ * i / kTableSteps);
    // Rising in between, so that halving the interval finds it.
    double low = 0;
    double high = most_slope;
    while (high - low > 1e-15 * most_slope) {
      const double middle = 0.5 * (low + high);
      if (middle == low || middle == high) break;
      (middle * distortion(k1, k2, middle * middle) < radius ? low : high) = middle;
    }
    factors_.push_back(radius > 0 ? 0.5 * (low + high) / radius : 1.0);
  }
}

Eigen::Vector2d RadialDistortion::distorted(const Eigen::Vector2d& slope) const {
  return slope * distortion(k1_, k2_, slope.squaredNorm());
}

Eigen::Vector2d RadialDistortion::undistorted(const Eigen::Vector2d& slope) const {
  const double at = std::min(slope.squaredNorm() / most_squared_, 1.0) * kTableSteps;
  const int below = std::min(static_cast<int>(at), kTableSteps - 1);
  const auto i = static_cast<std::size_t>(below);
  return slope * std::lerp(factors_[i], factors_[i + 1], at - below);
}

RadialDistortion distortion_of(const CameraTruth& camera) {
  return {camera.k1, camera.k2, 1.5 * most_slope(camera)};
}

std::vector<Eigen::Vector2d> ray_places(int rays) {
  int stride = std::max(1, static_cast<int>(std::lround(rays / std::numbers::phi)));
  while (std::gcd(stride, rays) != 1) --stride;
  // The integral of the tent turned round.
  const auto place = [rays](int i) {
    const double part = (i + 0.5) / rays;
    return part < 0.5 ? std::sqrt(2 * part) - 0.5 : 1.5 - std::sqrt(2 * (1 - part));
  };
  std::vector<Eigen::Vector2d> places;
  for (int i = 0; i < rays; ++i) places.emplace_back(place(i), place(i * stride % rays));
  return places;
}

Eigen::Vector3d board_corner(const BoardTruth& board, int column, int row) {
  return {column * board.square_m, row * board.square_m, 0};
}

double board_reflectance(const BoardTruth& board,
                         const Eigen::Vector2d& point,
                         const Eigen::Vector2d& width) {
  const auto [half, middle] = extent(board);
  if (!(((point - middle).cwiseAbs() - half).maxCoeff() <= 0)) return 0;
  const Eigen::Vector2d at = point / board.square_m;
  if (at.minCoeff() < -1 || at.x() >= board.columns || at.y() >= board.rows) return board.white;
  const Eigen::Vector2d box = width / board.square_m;
  const double chequer = square_wave(at.x(), box.x()) * square_wave(at.y(), box.y());
  return std::lerp(board.white, board.black, 0.5 * (1 + chequer));
}

Eigen::Vector2d camera_pixel(const CameraTruth& camera, const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d x = camera.world_from_camera.inverse() * x_in_world;
  const Eigen::Vector2d slope = x.head<2>() / x.z();
  return camera.focal_px * slope * distortion(camera.k1, camera.k2, slope.squaredNorm()) +
         camera.principal_point;
}

Result<std::vector<RigidTransform>> board_poses(const BoardTruth& board,
                                                const CameraTruth& camera,
                                                const ProjectorTruth& projector) {
  constexpr int kAttempts = 2000;  // a pose; each costs some microseconds
  constexpr double kNear = 0.85;   // of the reference distance
  constexpr double kFar = 1.25;
  constexpr double kAside_m = 0.03;
  constexpr double kRoll_rad = 0.2;  // less than would leave in doubt which corner is the first
  const Eigen::Vector3d lens = projector.world_from_projector.translation;
  const Eigen::Vector3d axis = projector.world_from_projector.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d right = projector.world_from_projector.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d down = projector.world_from_projector.rotation * Eigen::Vector3d::UnitY();
  const Eigen::Vector3d between = 0.5 * (lens + camera.world_from_camera.translation);
  const double tilt = to_radians(Degrees{board.tilt_deg}).value;
  const auto [half, middle] = extent(board);

  std::vector<RigidTransform> poses;
  for (int pose = 0; pose < board.poses; ++pose) {
    Pcg32 random(board.seed, static_cast<std::uint64_t>(pose));
    const auto spread = [&random](double most) { return most * (2 * random.uniform() - 1); };
    bool found = false;
    for (int attempt = 0; attempt < kAttempts && !found; ++attempt) {
      const double distance =
          projector.reference_distance_m * std::lerp(kNear, kFar, random.uniform());
      const Eigen::Vector3d centre =
          lens + distance * axis + spread(kAside_m) * right + spread(kAside_m) * down;
      // Square to the line from between the lenses, then tilted about an axis that goes round.
      const RigidTransform square = look_at(between, centre, -down);
      const double azimuth = 2 * std::numbers::pi * (pose + 0.4 * random.uniform()) / board.poses;
      const double angle = tilt * (0.75 + 0.25 * random.uniform());
      RigidTransform world_from_board;
      world_from_board.rotation =
          square.rotation *
          Eigen::Quaterniond(
              Eigen::AngleAxisd(angle, Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0))) *
          Eigen::Quaterniond(Eigen::AngleAxisd(spread(kRoll_rad), Eigen::Vector3d::UnitZ()));
      world_from_board.translation =
          centre - world_from_board.rotation * Eigen::Vector3d(middle.x(), middle.y(), 0);
      found = fits(board, camera, projector, world_from_board);
      if (found) poses.push_back(world_from_board);
    }
    if (!found)
      return fail(Errc::kInvalidOption,
                  "placing the board on the bench: one of {:.3f} x {:.3f} m, tilted by {} degrees, "
                  "does not fit into what projector and camera both see; make the board smaller or "
                  "aim the camera better",
                  2 * half.x(),
                  2 * half.y(),
                  board.tilt_deg);
  }
  return poses;
}

BoardView::BoardView(const BoardTruth& board,
                     const CameraTruth& camera,
                     const VirtualProjector& projector,
                     const ProjectorTruth& projector_truth,
                     const RigidTransform& world_from_board)
    : width_(camera.width), height_(camera.height) {
  const RadialDistortion lens = distortion_of(camera);
  const RigidTransform board_from_camera = world_from_board.inverse() * camera.world_from_camera;
  const Eigen::Matrix3d board_rotation = board_from_camera.rotation.toRotationMatrix();
  const Eigen::Vector3d projector_in_board =
      world_from_board.inverse() * projector_truth.world_from_projector.translation;
  const std::vector<Eigen::Vector2d> places = ray_places(camera.samples * camera.samples);
  const auto rays = static_cast<double>(places.size());

  const auto [half, centre] = extent(board);
  const Eigen::Vector2d board_half = half;
  const Eigen::Vector2d board_middle = centre;

  /// Where a place of the picture looks onto the board's plane; nothing where past it.
  const auto on_plane = [&](double x, double y) -> std::optional<Eigen::Vector2d> {
    const Eigen::Vector2d slope =
        lens.undistorted((Eigen::Vector2d(x, y) - camera.principal_point) / camera.focal_px);
    const Eigen::Vector3d ray = board_rotation * slope.homogeneous();
    const double along = -board_from_camera.translation.z() / ray.z();
    if (!(along > 0) || !(ray.z() > 0)) return std::nullopt;
    return board_from_camera.translation.head<2>() + along * ray.head<2>();
  };
  const auto in_world = [&](const Eigen::Vector2d& point) {
    return world_from_board * Eigen::Vector3d(point.x(), point.y(), 0);
  };
  /// G, which hardly varies over a pixel.
  const auto geometry = [&](const Eigen::Vector2d& point) {
    const Eigen::Vector3d to_lens = projector_in_board - Eigen::Vector3d(point.x(), point.y(), 0);
    const auto pixel = projector.pixel_of(in_world(point));
    if (!pixel || !(to_lens.z() < 0)) return 0.0;
    const double distance = to_lens.norm();
    return -to_lens.z() / distance * std::pow(projector_truth.reference_distance_m / distance, 2) *
           projector.vignetting(*pixel);
  };

  std::vector<std::vector<Sample>> rows(static_cast<std::size_t>(height_));
  const std::size_t pixels = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  first_.assign(pixels + 1, 0);
  reflectance_.assign(pixels, 0);
  const auto see = [&](int x, int y, std::vector<Sample>& row, float& reflectance_sum) {
    double strength = -1;  // of the pixel; not known yet
    // How far apart the rays meet the board: chequers are averaged in between, or else an edge
    // would move in steps of the rays.
    const auto middle = on_plane(x + 0.5, y + 0.5);
    const auto right = on_plane(x + 1.5, y + 0.5);
    const auto below = on_plane(x + 0.5, y + 1.5);
    if (!middle || !right || !below) return;
    const Eigen::Vector2d spacing =
        ((*right - *middle).cwiseAbs2() + (*below - *middle).cwiseAbs2()).cwiseSqrt() /
        camera.samples;
    const Eigen::Vector2d pixel_side = camera.samples * spacing;
    if (((*middle - board_middle).cwiseAbs() - board_half - 2 * pixel_side).maxCoeff() > 0) return;
    for (const Eigen::Vector2d& place : places) {
      const auto point = on_plane(x + place.x(), y + place.y());
      if (!point) continue;
      const double reflectance = board_reflectance(board, *point, spacing);
      if (reflectance == 0) continue;
      reflectance_sum += static_cast<float>(reflectance / rays);
      const auto raster = projector.pixel_of(in_world(*point));
      if (!raster) continue;
      if (strength < 0) strength = geometry(*point);
      row.push_back(
          {static_cast<std::uint32_t>(static_cast<int>(raster->y()) * projector_truth.width +
                                      static_cast<int>(raster->x())),
           static_cast<float>(reflectance * strength / rays)});
    }
  };
  parallel_for(height_, 8, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y)
      for (int x = 0; x < width_; ++x) {
        const std::size_t pixel =
            y * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
        see(x, static_cast<int>(y), rows[y], reflectance_[pixel]);
        first_[pixel + 1] = static_cast<std::uint32_t>(rows[y].size());  // within the row, for now
      }
  });
  for (std::size_t y = 0; y < rows.size(); ++y) {
    const auto before = static_cast<std::uint32_t>(samples_.size());
    const std::size_t start = y * static_cast<std::size_t>(width_) + 1;
    for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) first_[start + x] += before;
    samples_.insert(samples_.end(), rows[y].begin(), rows[y].end());
  }
}

Image<Rgb32f> BoardView::gather(const Image<Rgb32f>& raster,
                                float lamp,
                                const Rgb32f& ambient) const {
  Image<Rgb32f> picture(width_, height_);
  const auto width = static_cast<std::size_t>(width_);
  parallel_for(height_, 16, [&](std::int64_t begin, std::int64_t end) {
    for (std::size_t pixel = static_cast<std::size_t>(begin) * width;
         pixel < static_cast<std::size_t>(end) * width;
         ++pixel) {
      Rgb32f sum = Rgb32f::Zero();
      for (std::uint32_t i = first_[pixel]; i < first_[pixel + 1]; ++i)
        sum += samples_[i].weight * raster.pixels()[samples_[i].raster_pixel];
      picture.pixels()[pixel] = lamp * sum + reflectance_[pixel] * ambient;
    }
  });
  return picture;
}

}  // namespace veneer::simulation
