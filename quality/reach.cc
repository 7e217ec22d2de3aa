// SPDX-License-Identifier: Apache-2.0
#include "quality/reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "btf/elevated_concentric.h"
#include "btf/spherical_interpolation.h"
#include "quality/low_discrepancy.h"
#include "quality/projected_surface.h"

namespace veneer::quality {
namespace {

using btf::Direction;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Of the corners of the mesh and the edges of the regions that the boxes hold beside the samples.
constexpr std::size_t kMostCorners = 1500;
constexpr int kAlongAzimuth = 9;
constexpr int kAlongElevation = 5;

// Nearer to the surface than this an eye or a lamp is on it, and has no direction.
constexpr double kTouching_m = 1e-9;

struct Box {
  Vector2d low = Vector2d::Constant(HUGE_VAL);
  Vector2d high = Vector2d::Constant(-HUGE_VAL);
  double theta_max = 0;
  void add(const Direction& direction) {
    const Vector2d st = btf::square_from_direction(direction);
    low = low.cwiseMin(st);
    high = high.cwiseMax(st);
    theta_max = std::max(theta_max, std::acos(std::min(1.0, direction.z())));
  }
  // How far this reaches beyond a box inside it.
  [[nodiscard]] double beyond(const Box& inner) const {
    return std::max((inner.low - low).maxCoeff(), (high - inner.high).maxCoeff());
  }
  [[nodiscard]] btf::DirectionBox grown(double by) const {
    const double margin = std::max(kLeastMargin, by);
    const Vector2d from = (low.array() - margin).cwiseMax(0.0);
    const Vector2d to = (high.array() + margin).cwiseMin(1.0);
    return {from.x(), to.x(), from.y(), to.y()};
  }
};

// What is under way from a point to a place; nothing where they touch.
struct Way {
  Direction direction;  // local
  double distance;
};
std::optional<Way> way(const SurfacePoint& point, const Vector3d& place) {
  const Vector3d to = place - point.position;
  const double distance = to.norm();
  if (!(distance > kTouching_m)) return std::nullopt;
  return Way{point.local_from_world * (to / distance), distance};
}

// A light as seen from a point. @param at  where in its region.
std::optional<Asked::Lit> lit_by(const render::Scene& scene,
                                 std::size_t light,
                                 const SurfacePoint& point,
                                 const Vector3d& at) {
  const std::optional<render::Region> region =
      light < scene.light_regions.size() ? scene.light_regions[light] : std::nullopt;
  if (const auto* lamp = std::get_if<render::PointLight>(&scene.lights[light])) {
    const auto to = way(point, region ? render::point_in(*region, at) : lamp->position);
    if (!to) return std::nullopt;
    return Asked::Lit{to->direction, lamp->intensity_rgb / (to->distance * to->distance)};
  }
  const auto& sun = std::get<render::DirectionalLight>(scene.lights[light]);
  const Vector3d direction = region ? (render::point_in(*region, at) - region->centre).normalized()
                                    : sun.direction_to_light;
  return Asked::Lit{point.local_from_world * direction, sun.illuminance_rgb};
}

Vector3d rgb_of(const render::Light& light) {
  if (const auto* lamp = std::get_if<render::PointLight>(&light)) return lamp->intensity_rgb;
  return std::get<render::DirectionalLight>(light).illuminance_rgb;
}

// Spreads what is asked over the measured pairs, and holds the boxes.
class Density {
 public:
  explicit Density(const btf::SampleSetInfo& set)
      : views_(set.views, btf::DirectionRole::kView),
        lights_(set.lights, btf::DirectionRole::kLight),
        light_count_(set.lights.size()),
        weight_(static_cast<std::size_t>(set.pair_count())) {}

  void add(const Asked& asked) {
    const btf::DirectionWeights v = views_.weights(asked.view);
    for (int k = 0; k < asked.lights; ++k) {
      const btf::DirectionWeights l = lights_.weights(asked.lit[static_cast<std::size_t>(k)].light);
      const double weight = asked.weight * l.scale * l.scale;
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
          weight_[static_cast<std::size_t>(v.index[i]) * light_count_ +
                  static_cast<std::size_t>(l.index[j])] += weight * v.weight[i] * l.weight[j];
    }
  }
  // With the mean over all pairs 1, as where nobody says; what is lost in single precision is 0.
  [[nodiscard]] std::vector<float> weights() const {
    const double sum = std::accumulate(weight_.begin(), weight_.end(), 0.0);
    std::vector<float> weights;
    for (const double w : weight_)
      weights.push_back(static_cast<float>(w * static_cast<double>(weight_.size()) / sum));
    return weights;
  }

 private:
  btf::SphericalInterpolator views_;
  btf::SphericalInterpolator lights_;
  std::size_t light_count_;
  std::vector<double> weight_;
};

struct Footprint {
  double texels;
  double pixels;
};

// The number of texels under which the part `rank` of the pixels stays.
double footprint_at(const std::vector<Footprint>& sorted, double rank) {
  double sum = 0;
  for (const Footprint& f : sorted) sum += f.pixels;
  double below = 0;
  for (const Footprint& f : sorted)
    if ((below += f.pixels) >= rank * sum) return f.texels;
  return 0;
}

Vector3d in_cube(double a, double b, double c) { return {a, b, c}; }

// Corners of the mesh seen from the edges of the regions, which samples inside never quite reach.
void add_edges(const render::Scene& scene,
               const ProjectedSurface& surface,
               const std::vector<std::size_t>& lights,
               double geometry_floor,
               Box& view_box,
               Box& light_box) {
  std::vector<Vector3d> edges;
  for (int a = 0; a < kAlongAzimuth; ++a)
    for (int e = 0; e < kAlongElevation; ++e)
      for (int r = 0; r < 2; ++r)
        edges.push_back(in_cube(a / (kAlongAzimuth - 1.0), e / (kAlongElevation - 1.0), double(r)));
  const std::size_t corners = 3 * surface.triangles();
  const std::size_t stride = std::max<std::size_t>(1, corners / kMostCorners);
  for (std::size_t c = 0; c < corners; c += stride) {
    const auto point = surface.corner(c, geometry_floor);
    if (!point) continue;
    std::vector<Direction> seen;
    std::vector<Direction> lit;
    for (const Vector3d& at : edges) {
      const auto eye = way(*point, render::point_in(*scene.observer_region, at));
      if (eye && eye->direction.z() > 0) seen.push_back(eye->direction);
      for (const std::size_t light : lights) {
        const auto from = lit_by(scene, light, *point, at);
        if (from && from->light.z() > 0) lit.push_back(from->light);
      }
    }
    if (seen.empty() || lit.empty()) continue;
    for (const Direction& d : seen) view_box.add(d);
    for (const Direction& d : lit) light_box.add(d);
  }
}

// Of an object that may be held any way: every direction from everywhere.
Reach everything(const render::Scene& scene,
                 const calibration::ProjectorProfile& profile,
                 const btf::SampleSetInfo& set,
                 const std::vector<std::size_t>& lights,
                 const ReachOptions& options) {
  Reach reach;
  reach.any_pose = true;
  reach.region.weights.weight.assign(static_cast<std::size_t>(set.pair_count()), 1.0F);
  reach.reached_pairs = 1;
  reach.view_theta_max = reach.light_theta_max = std::numbers::pi / 2;
  const LowDiscrepancy<8> sequence;
  for (std::size_t i = 0; i < options.kept; ++i) {
    const auto at = sequence(i);
    Asked asked;
    // By area of the hemisphere times the cosine with which it is seen.
    asked.view =
        btf::direction_from_angles({std::asin(std::sqrt(at[0])), 2 * std::numbers::pi * at[1]});
    for (std::size_t k = 0; k < lights.size(); ++k) {
      const double turn = at[3] + static_cast<double>(k) / static_cast<double>(lights.size());
      const Direction light =
          btf::direction_from_angles({std::acos(1.0 - at[2]), 2 * std::numbers::pi * turn});
      const render::Light& source = scene.lights[lights[k]];
      Vector3d rgb = rgb_of(source);
      if (const auto* lamp = std::get_if<render::PointLight>(&source)) {
        const double distance = (lamp->position - scene.world_from_object.translation).norm();
        rgb /= std::max(distance * distance, kTouching_m);
      }
      asked.lit[static_cast<std::size_t>(asked.lights++)] = {light, rgb};
    }
    asked.repeats = {at[4], at[5]};
    asked.pixel = {at[6] * profile.geometry.width, at[7] * profile.geometry.height};
    asked.vignetting = profile.vignetting_at(asked.pixel);
    reach.asked.push_back(asked);
  }
  return reach;
}

}  // namespace

Status ReachOptions::check() const {
  constexpr std::size_t kLeast = 1024;
  constexpr std::size_t kMost = std::size_t{1} << 24U;
  if (samples < kLeast || samples > kMost)
    return fail(Errc::kInvalidOption,
                "finding the reach: {} samples; take {} to {}",
                samples,
                kLeast,
                kMost);
  if (kept < 1 || kept > samples)
    return fail(Errc::kInvalidOption,
                "finding the reach: {} of {} samples are to be kept; take 1 or more, and no more "
                "than there are",
                kept,
                samples);
  if (!(geometry_floor > 0.0 && geometry_floor < 1e3))
    return fail(Errc::kInvalidOption,
                "finding the reach: the geometry floor is {}; it must be above 0",
                geometry_floor);
  return {};
}

Result<Reach> find_reach(const render::Scene& scene,
                         const calibration::ProjectorProfile& profile,
                         const btf::SampleSetInfo& set,
                         Progress& progress,
                         const ReachOptions& options) {
  VENEER_TRY(options.check());
  std::vector<std::size_t> lights;
  for (std::size_t i = 0; i < scene.lights.size(); ++i)
    if (rgb_of(scene.lights[i]).maxCoeff() > 0.0) lights.push_back(i);
  if (lights.empty())
    return fail(Errc::kInvalidOption,
                "finding the reach: every light of the scene is off; give one an illuminance_lux "
                "or intensity_cd above 0");
  if (scene.object_body >= 0) return everything(scene, profile, set, lights, options);
  if (!scene.observer_region)
    return fail(Errc::kInvalidOption,
                "finding the reach: the scene does not say where the observer may be; add "
                "[observer.region] with centre, radius_m, azimuth_deg and elevation_deg to it");

  const ProjectedSurface surface(scene, profile);
  const LowDiscrepancy<9> sequence;
  Density density(set);
  Reach reach;
  Box view_box;
  Box light_box;
  Box half_view_box;
  Box half_light_box;
  std::vector<Footprint> footprints;
  std::size_t reached = 0;
  std::size_t asked_of = 0;
  std::size_t below = 0;
  constexpr std::size_t kStep = 4096;
  progress.start("finding what the scene can ask", static_cast<std::int64_t>(options.samples));
  for (std::size_t i = 0; i < options.samples; ++i) {
    if (i == options.samples / 2) {
      half_view_box = view_box;
      half_light_box = light_box;
    }
    if (i % kStep == 0)
      progress.advance(static_cast<std::int64_t>(std::min(kStep, options.samples - i)));
    const auto at = sequence(i);
    const auto point = surface.at(in_cube(at[0], at[1], at[2]), options.geometry_floor);
    if (!point) continue;
    ++reached;
    footprints.push_back(
        {point->repeats_per_pixel * std::sqrt(static_cast<double>(set.texel_count())),
         point->pixels_per_area});
    const auto eye =
        way(*point, render::point_in(*scene.observer_region, in_cube(at[3], at[4], at[5])));
    if (!eye) continue;
    Asked asked;
    asked.view = eye->direction;
    for (const std::size_t light : lights) {
      // Each light elsewhere in its region, or two alike would move together.
      const double shift = static_cast<double>(light) / render::kMaxLights;
      const auto from =
          lit_by(scene,
                 light,
                 *point,
                 in_cube(std::fmod(at[6] + shift, 1.0), std::fmod(at[7] + shift, 1.0), at[8]));
      ++asked_of;
      if (!from || !(from->light.z() > 0.0) || !(eye->direction.z() > 0.0)) {
        ++below;
        continue;
      }
      asked.lit[static_cast<std::size_t>(asked.lights++)] = *from;
    }
    if (asked.lights == 0) continue;
    view_box.add(asked.view);
    for (int k = 0; k < asked.lights; ++k)
      light_box.add(asked.lit[static_cast<std::size_t>(k)].light);
    asked.repeats = point->repeats;
    asked.pixel = point->pixel;
    asked.geometry = point->geometry;
    asked.vignetting = point->vignetting;
    asked.weight = asked.view.z() / (eye->distance * eye->distance);
    density.add(asked);
    if (reach.asked.size() < options.kept) reach.asked.push_back(asked);
  }
  if (reached == 0)
    return fail(Errc::kInvalidOption,
                "finding the reach: the projector of the profile lights nothing of the object; "
                "look at [object] in the scene and at world_from_projector in the profile");
  if (reach.asked.empty())
    return fail(Errc::kInvalidOption,
                "finding the reach: wherever the projector lights the object, every light or the "
                "whole observer region is behind the surface; look at [[light]] and "
                "[observer.region] in the scene");
  const double view_margin = view_box.beyond(half_view_box);
  const double light_margin = light_box.beyond(half_light_box);
  add_edges(scene, surface, lights, options.geometry_floor, view_box, light_box);
  reach.region.views = view_box.grown(view_margin);
  reach.region.lights = light_box.grown(light_margin);
  reach.region.weights.weight = density.weights();
  const auto& weights = reach.region.weights.weight;
  reach.reached_pairs =
      static_cast<double>(std::ranges::count_if(weights, [](float w) { return w > 0.0F; })) /
      static_cast<double>(weights.size());
  reach.view_theta_max = view_box.theta_max;
  reach.light_theta_max = light_box.theta_max;
  reach.below_horizon = static_cast<double>(below) / static_cast<double>(asked_of);
  std::ranges::sort(footprints, {}, &Footprint::texels);
  reach.texels_per_pixel_median = footprint_at(footprints, 0.5);
  reach.texels_per_pixel_p95 = footprint_at(footprints, 0.95);
  progress.finish(fmt::format("{:.1f} % of the measured pairs", 100 * reach.reached_pairs));
  return reach;
}

}  // namespace veneer::quality
