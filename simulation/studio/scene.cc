// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/parallel.h"

namespace veneer::simulation::studio {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
// Rec. 709: what a monochrome sensor sees of linear sRGB.
const Rgb32f kLuminance(0.2126F, 0.7152F, 0.0722F);
// Of the analysers on the sensor: rows of 2 x 2 cells, degrees.
constexpr std::array<std::array<double, 2>, 2> kMosaic_deg{{{90, 45}, {135, 0}}};
// Two orders for the analyser nearer than this are one.
constexpr double kSameAngle_rad = 1e-3;

/// Distance to where a ray enters a ball.
std::optional<double> meet_ball(const Eigen::Vector3d& origin,
                                const Eigen::Vector3d& direction,
                                const Eigen::Vector3d& centre,
                                double radius) {
  const Eigen::Vector3d from_centre = origin - centre;
  const double half = from_centre.dot(direction);
  const double discriminant = half * half - (from_centre.squaredNorm() - radius * radius);
  if (!(discriminant > 0)) return std::nullopt;
  const double along = -half - std::sqrt(discriminant);
  if (!(along > 0)) return std::nullopt;
  return along;
}

}  // namespace

StudioScene::StudioScene(const StudioTruth& truth,
                         const capture::CapturePlan& plan,
                         StudioGeometry geometry,
                         BoardPicture board,
                         TracedSample sample,
                         std::vector<Eigen::Vector3d> lights)
    : truth_(truth),
      plan_(plan),
      geometry_(std::move(geometry)),
      board_(std::move(board)),
      sample_(std::move(sample)),
      lights_(std::move(lights)) {
  for (int y = 0; y < geometry_.height(); ++y)
    for (int x = 0; x < geometry_.width(); ++x)
      vignetting_.push_back(static_cast<float>(geometry_.vignetting({x + 0.5, y + 0.5})));
}

void StudioScene::look(int view) {
  if (seen_view_ == view) return;
  seen_view_ = view;
  const RigidTransform pose = geometry_.local_from_camera(view);
  const auto width = static_cast<std::size_t>(geometry_.width());
  const auto height = static_cast<std::size_t>(geometry_.height());
  seen_.rows.assign(height, {});
  seen_.first.assign(height * (width + 1), 0);
  seen_.area.assign(height * width, 0);
  seen_.board.assign(height * width, 0);
  seen_.fall_off.assign(height * width, 0);
  constexpr float kShare = 1.0F / StudioGeometry::kRays;
  parallel_for(geometry_.height(), 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y) {
      std::vector<Seen::Part>& parts = seen_.rows[y];
      for (std::size_t x = 0; x < width; ++x) {
        const std::size_t pixel = y * width + x;
        const Eigen::Vector2d corner(x, y);
        const std::size_t first = parts.size();
        seen_.first[y * (width + 1) + x] = static_cast<std::uint32_t>(first);
        for (const Eigen::Vector2d& place : geometry_.ray_places()) {
          const auto ray = geometry_.ray(pose, corner + place);
          const auto on_sample = meet_plane(ray, 0);
          const auto texel = on_sample ? geometry_.texel(*on_sample) : std::nullopt;
          if (texel) {
            seen_.area[pixel] += kShare;
            const auto known =
                std::find_if(parts.begin() + static_cast<std::ptrdiff_t>(first),
                             parts.end(),
                             [&](const Seen::Part& part) { return part.texel == *texel; });
            if (known == parts.end())
              parts.push_back({*texel, kShare});
            else
              known->weight += kShare;
          } else if (const auto on_board = meet_plane(ray, geometry_.board_z())) {
            seen_.board[pixel] += kShare * board_.reflectance(geometry_.board_place(*on_board));
          }
        }
        const auto middle = meet_plane(geometry_.ray(pose, corner + Eigen::Vector2d(0.5, 0.5)), 0);
        seen_.fall_off[pixel] = middle ? static_cast<float>(geometry_.fall_off(*middle)) : 0;
      }
      seen_.first[y * (width + 1) + width] = static_cast<std::uint32_t>(parts.size());
    }
  });
}

void StudioScene::lay_sample(Layers& layers) const {
  const int columns = geometry_.area().columns;
  const auto width = static_cast<std::size_t>(geometry_.width());
  std::vector<TracedSample::Texel> lit;
  std::vector<Rgb32f> room;
  for (int row = 0; row < geometry_.area().rows; ++row)
    for (int column = 0; column < columns; ++column) {
      lit.push_back(sample_.texel(layers.view, layers.light, column, row));
      room.push_back(sample_.in_room_light(layers.view, column, row));
    }
  for (std::size_t y = 0; y < seen_.rows.size(); ++y)
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t pixel = y * width + x;
      for (auto i = seen_.first[y * (width + 1) + x]; i < seen_.first[y * (width + 1) + x + 1];
           ++i) {
        const Seen::Part& part = seen_.rows[y][i];
        layers.mirrored.pixels()[pixel] += part.weight * lit[part.texel].specular;
        layers.lost.pixels()[pixel] += part.weight * lit[part.texel].diffuse;
        layers.room.pixels()[pixel] += part.weight * room[part.texel];
      }
    }
}

void StudioScene::lay_plate(Layers& layers, double mirrored, double lost, double room) const {
  for (std::size_t pixel = 0; pixel < seen_.area.size(); ++pixel) {
    const Rgb32f covered = Rgb32f::Constant(seen_.area[pixel]);
    layers.mirrored.pixels()[pixel] += static_cast<float>(mirrored) * covered;
    layers.lost.pixels()[pixel] += static_cast<float>(lost) * covered;
    layers.room.pixels()[pixel] += static_cast<float>(room) * covered;
  }
}

void StudioScene::lay_ball(Layers& layers) const {
  const RigidTransform pose = geometry_.local_from_camera(layers.view);
  const Eigen::Vector3d& light = lights_[static_cast<std::size_t>(layers.light)];
  const double radius = plan_.ball_radius_mm;
  const Eigen::Vector3d centre(0, 0, geometry_.board_z() + radius);
  struct Light {
    float mirrored = 0, lost = 0, room = 0;
  };
  // The board, the sample's place included, with the ball's shadow on it.
  const auto on_board = [&](const StudioGeometry::Ray& ray) -> Light {
    const auto place = meet_plane(ray, geometry_.board_z());
    if (!place) return {};
    const float reflectance = board_.reflectance(geometry_.board_place(*place));
    const bool in_shadow = meet_ball(*place, light, centre, radius).has_value();
    return {0, in_shadow ? 0 : reflectance * static_cast<float>(light.z()), reflectance};
  };
  const auto seen = [&](const StudioGeometry::Ray& ray) -> Light {
    const auto along = meet_ball(ray.origin, ray.direction, centre, radius);
    if (!along) return on_board(ray);
    const Eigen::Vector3d place = ray.origin + *along * ray.direction;
    const Eigen::Vector3d normal = (place - centre) / radius;
    const Eigen::Vector3d mirrored = ray.direction - 2 * ray.direction.dot(normal) * normal;
    const Light board = on_board({place, mirrored});
    Light sum{0,
              static_cast<float>(kBallReflectance) * board.lost +
                  static_cast<float>(kScatter * std::max(0.0, normal.dot(light))),
              static_cast<float>(kBallReflectance) * board.room};
    // The chord is the angle where the lobe is not dark.
    const double off = (mirrored - light).norm() / kBallLobe_rad;
    sum.mirrored = static_cast<float>(kMirrorStrength * std::exp(-0.5 * off * off));
    return sum;
  };
  parallel_for(geometry_.height(), 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < geometry_.width(); ++x) {
        Light sum;
        for (const Eigen::Vector2d& place : geometry_.ray_places()) {
          const Light light_of_ray = seen(geometry_.ray(pose, Eigen::Vector2d(x, y) + place));
          sum.mirrored += light_of_ray.mirrored;
          sum.lost += light_of_ray.lost;
          sum.room += light_of_ray.room;
        }
        constexpr float kShare = 1.0F / StudioGeometry::kRays;
        layers.mirrored(x, y).setConstant(kShare * sum.mirrored);
        layers.lost(x, y).setConstant(kShare * sum.lost);
        layers.room(x, y).setConstant(kShare * sum.room);
      }
  });
}

void StudioScene::lay(const Arrangement& arrangement) {
  look(arrangement.view);
  if (layers_.target == arrangement.target && layers_.view == arrangement.view &&
      layers_.light == arrangement.light)
    return;
  layers_ = {arrangement.target, arrangement.view, arrangement.light, {}, {}, {}};
  for (auto* const image : {&layers_.mirrored, &layers_.lost, &layers_.room})
    *image = Image<Rgb32f>(geometry_.width(), geometry_.height());
  const double cos_light = lights_[static_cast<std::size_t>(arrangement.light)].z();
  switch (arrangement.target) {
    case capture::Target::kSample:
      lay_sample(layers_);
      break;
    case capture::Target::kWhite:
      lay_plate(layers_, 0, plan_.white_reflectance * cos_light, plan_.white_reflectance);
      break;
    case capture::Target::kMirror:
      lay_plate(layers_,
                plan_.mirror_light == arrangement.light ? kMirrorStrength : 0,
                kScatter * cos_light,
                kScatter);
      break;
    case capture::Target::kMirrorBall:
      lay_ball(layers_);
      return;
  }
  for (std::size_t pixel = 0; pixel < seen_.board.size(); ++pixel) {
    const Rgb32f board = Rgb32f::Constant(seen_.board[pixel]);
    layers_.lost.pixels()[pixel] += static_cast<float>(cos_light) * board;
    layers_.room.pixels()[pixel] += board;
  }
}

Beam StudioScene::mirrored_beam(const Arrangement& arrangement) const {
  const Eigen::Vector3d& light = lights_[static_cast<std::size_t>(arrangement.light)];
  const Eigen::Vector3d view = plan_.views[static_cast<std::size_t>(arrangement.view)];
  const Beam sent = polarised_beam(light, plan_.polarisation.axis, truth_.light_extinction);
  return arrangement.target == capture::Target::kSample
             ? reflected_by_dielectric(sent, light, view, truth_.index)
             : reflected_by_mirror(sent, light, view);
}

Image<Rgb32f> StudioScene::light(const Arrangement& arrangement) {
  lay(arrangement);
  const Eigen::Vector3d view = plan_.views[static_cast<std::size_t>(arrangement.view)];
  const Beam mirrored = mirrored_beam(arrangement);
  const auto& angles = plan_.polarisation.analyser_rad;
  const bool second = !truth_.mosaic && angles.size() > 1 &&
                      std::abs(arrangement.analyser_rad - angles[1]) < kSameAngle_rad;
  const double lamp =
      arrangement.dark ? 0 : truth_.irradiance * (second ? truth_.polarised_gain : 1);
  const double room = truth_.irradiance * truth_.ambient;

  struct Passed {
    float mirrored = 0, lost = 0, room = 0;
  };
  const auto passed_at = [&](double angle_rad) -> Passed {
    const Analyser analyser(view,
                            plan_.polarisation.axis,
                            angle_rad + truth_.misalignment_deg * kDegree,
                            truth_.analyser_extinction);
    return {static_cast<float>(lamp * analyser.passed(mirrored)),
            static_cast<float>(lamp * analyser.passed_unpolarised()),
            static_cast<float>(room * analyser.passed_unpolarised())};
  };
  // Of a cell of 2 x 2 pixels.
  std::array<std::array<Passed, 2>, 2> cell;
  for (std::size_t row = 0; row < 2; ++row)
    for (std::size_t column = 0; column < 2; ++column)
      cell[row][column] =
          passed_at(truth_.mosaic ? kMosaic_deg[row][column] * kDegree : arrangement.analyser_rad);

  const auto width = static_cast<std::size_t>(geometry_.width());
  Image<Rgb32f> light(geometry_.width(), geometry_.height());
  parallel_for(geometry_.height(), 32, [&](std::int64_t begin, std::int64_t end) {
    for (auto pixel = static_cast<std::size_t>(begin) * width;
         pixel < static_cast<std::size_t>(end) * width;
         ++pixel) {
      const Passed& passed = cell[pixel / width % 2][pixel % width % 2];
      const Rgb32f lit = passed.mirrored * layers_.mirrored.pixels()[pixel] +
                         passed.lost * layers_.lost.pixels()[pixel];
      const Rgb32f sum = vignetting_[pixel] *
                         (seen_.fall_off[pixel] * lit + passed.room * layers_.room.pixels()[pixel]);
      light.pixels()[pixel] = truth_.mosaic ? Rgb32f::Constant(kLuminance.dot(sum)) : sum;
    }
  });
  return light;
}

}  // namespace veneer::simulation::studio
