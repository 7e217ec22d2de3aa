// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/parallel.h"
#include "base/units.h"
#include "simulation/bench/state.h"

namespace veneer::simulation {
namespace {

SurfaceLight surface_light(const VirtualProjector& projector,
                           const Spectrum& ambient,
                           const Spectrum& albedo) {
  SurfaceLight light;
  for (int i = 0; i < VirtualProjector::kOutputs; ++i)
    light.outputs.col(i) = xyz_of(albedo * projector.primaries()[static_cast<std::size_t>(i)]);
  light.black = xyz_of(albedo * projector.black());
  light.ambient = xyz_of(albedo * ambient);
  return light;
}

/// The length of an eye pixel's side at distance 1 along the line of sight.
double eye_pixel(const EyeTruth& eye) {
  return 2.0 * std::tan(0.5 * to_radians(Degrees{eye.vertical_fov_deg}).value) / eye.height;
}

/// @param hits, lit  rays of the pixel that met the object, and those of them that get light.
Coverage coverage_of(int rays, int hits, int lit) {
  if (hits == 0) return Coverage::kOutside;
  if (hits < rays) return Coverage::kPartial;
  return lit == 0 ? Coverage::kUnlit : Coverage::kCovered;
}

}  // namespace

Bench::State::State(const BenchTruth& bench_truth, Mesh object)
    : truth(bench_truth),
      projector(truth.projector),
      mesh(std::move(object)),
      on_white(surface_light(projector,
                             planckian_light(truth.room.ambient_kelvin, truth.room.ambient_nits),
                             Spectrum::Ones())),
      on_object{
          surface_light(
              projector,
              planckian_light(truth.room.ambient_kelvin, truth.room.ambient_nits),
              interpolated_spectrum(truth.object.wavelength_nm, truth.object.reflectance)),
          surface_light(projector,
                        planckian_light(truth.room.ambient_kelvin, truth.room.ambient_nits),
                        interpolated_spectrum(truth.object.wavelength_nm,
                                              truth.object.texture == ObjectTruth::Texture::kNone
                                                  ? truth.object.reflectance
                                                  : truth.object.texture_reflectance))} {}

/// Which raster pixel lights a surface point, and how strongly.
EyeSample Bench::State::light(const MeshPoint& point,
                              const RigidTransform& world_from_object,
                              const Eigen::Vector3d& lens_in_object) const {
  EyeSample sample{point.triangle, point.u, point.v};
  const SurfacePoint surface = mesh.at(point);
  sample.painted = truth.object.painted(surface.uv);
  const Eigen::Vector3d to_lens = lens_in_object - surface.position;
  const double distance = to_lens.norm();
  const double cosine = surface.normal.dot(to_lens) / distance;
  if (!(cosine > 0)) return sample;
  const auto pixel = projector.pixel_of(world_from_object * surface.position);
  if (!pixel || mesh.hides(surface, lens_in_object)) return sample;
  const double fall_off = std::pow(truth.projector.reference_distance_m / distance, 2);
  sample.raster_pixel =
      static_cast<int>(pixel->y()) * truth.projector.width + static_cast<int>(pixel->x());
  sample.geometry = static_cast<float>(cosine * fall_off * projector.vignetting(*pixel));
  return sample;
}

Bench::Bench(std::unique_ptr<State> state) : state_(std::move(state)) {}
Bench::~Bench() = default;

Result<std::unique_ptr<Bench>> Bench::load(const std::filesystem::path& bench_toml) {
  VENEER_ASSIGN(const BenchTruth truth, BenchTruth::load(bench_toml));
  VENEER_ASSIGN(Mesh mesh, load_mesh(truth.object.mesh));
  return create(truth, std::move(mesh));
}

Result<std::unique_ptr<Bench>> Bench::create(const BenchTruth& truth, Mesh mesh) {
  if (const Status valid = truth.check(); !valid)
    return fail_while("setting up the bench", valid.error());
  if (mesh.triangles.empty())
    return fail(Errc::kInvalidOption, "setting up the bench: the object has no triangles");
  return std::unique_ptr<Bench>(new Bench(std::make_unique<State>(truth, std::move(mesh))));
}

const BenchTruth& Bench::truth() const { return state_->truth; }
const Mesh& Bench::mesh() const { return state_->mesh.mesh(); }

Result<EyeView> Bench::look(const RigidTransform& world_from_object,
                            const Eigen::Vector3d& eye_in_world) const {
  const Eigen::Vector3d& centre = world_from_object.translation;
  constexpr double kLeastDistance_m = 1e-3;
  if (!world_from_object.matrix().allFinite() ||
      !((eye_in_world - centre).norm() > kLeastDistance_m))
    return fail(
        Errc::kInvalidOption,
        "looking at the object: a pose is not finite, or the eye is at the object's origin");

  const EyeTruth& eye = state_->truth.eye;
  const RigidTransform object_from_world = world_from_object.inverse();
  const RigidTransform object_from_eye =
      object_from_world * look_at(eye_in_world, centre, Eigen::Vector3d::UnitY());
  const Eigen::Vector3d lens_in_object =
      object_from_world * state_->truth.projector.world_from_projector.translation;

  EyeView view;
  view.world_from_object = world_from_object;
  view.eye_in_object = object_from_eye.translation;
  view.rays_per_pixel = eye.samples * eye.samples;
  view.coverage = Image<Coverage>(eye.width, eye.height, Coverage::kOutside);
  std::vector<std::vector<EyeSample>> rows(static_cast<std::size_t>(eye.height));
  view.first.assign(view.coverage.pixels().size() + 1, 0);

  const double pixel_side = eye_pixel(eye);
  const auto trace_pixel = [&](int x, int y, std::vector<EyeSample>& row) {
    int hits = 0;
    int lit = 0;
    for (int j = 0; j < eye.samples; ++j)
      for (int i = 0; i < eye.samples; ++i) {
        const Eigen::Vector3d ray((x + (i + 0.5) / eye.samples - 0.5 * eye.width) * pixel_side,
                                  (y + (j + 0.5) / eye.samples - 0.5 * eye.height) * pixel_side,
                                  1.0);
        const auto hit = state_->mesh.trace(view.eye_in_object, object_from_eye.rotation * ray);
        if (!hit) continue;
        row.push_back(state_->light(*hit, world_from_object, lens_in_object));
        ++hits;
        if (row.back().geometry > 0) ++lit;
      }
    view.coverage(x, y) = coverage_of(view.rays_per_pixel, hits, lit);
  };
  parallel_for(eye.height, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y)
      for (int x = 0; x < eye.width; ++x) {
        trace_pixel(x, static_cast<int>(y), rows[y]);
        const std::size_t pixel =
            y * static_cast<std::size_t>(eye.width) + static_cast<std::size_t>(x);
        view.first[pixel + 1] =
            static_cast<std::uint32_t>(rows[y].size());  // within the row, for now
      }
  });

  for (std::size_t y = 0; y < rows.size(); ++y) {
    const auto before = static_cast<std::uint32_t>(view.samples.size());
    for (int x = 0; x < eye.width; ++x)
      view.first[y * static_cast<std::size_t>(eye.width) + static_cast<std::size_t>(x) + 1] +=
          before;
    view.samples.insert(view.samples.end(), rows[y].begin(), rows[y].end());
  }
  return view;
}

Result<Image<Rgb32f>> Bench::observe(const EyeView& view, ImageView<const Rgb16> codes) const {
  VENEER_ASSIGN(const Image<VirtualProjector::Light> light, state_->projector.project(codes));
  Image<Rgb32f> picture(view.width(), view.height(), Rgb32f::Zero());
  // What lights a pixel's parts that are not painted, and those that are.
  struct Lit {
    VirtualProjector::Outputs output = VirtualProjector::Outputs::Zero();
    double geometry = 0;
    int rays = 0;
  };
  for (std::size_t pixel = 0; pixel + 1 < view.first.size(); ++pixel) {
    std::array<Lit, 2> parts;
    for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i) {
      const EyeSample& sample = view.samples[i];
      Lit& part = parts[sample.painted ? 1 : 0];
      ++part.rays;
      if (sample.raster_pixel < 0) continue;
      part.output += sample.geometry *
                     light.pixels()[static_cast<std::size_t>(sample.raster_pixel)].cast<double>();
      part.geometry += sample.geometry;
    }
    Xyz sum = Xyz::Zero();
    for (std::size_t i = 0; i < 2; ++i) {
      const SurfaceLight& surface = state_->on_object[i];
      sum += surface.outputs * parts[i].output + parts[i].geometry * surface.black +
             parts[i].rays * surface.ambient;
    }
    picture.pixels()[pixel] = (sum / view.rays_per_pixel).cast<float>();
  }
  return picture;
}

Image<Rgb32f> Bench::material_truth(const EyeView& view,
                                    const TexelSource& material,
                                    const Eigen::Vector2d& repeats,
                                    const std::vector<BenchLight>& lights) const {
  VENEER_CHECK(material.width > 0 && material.height > 0 && material.radiance);
  const RigidTransform object_from_world = view.world_from_object.inverse();
  std::vector<BenchLight> local = lights;  // in the object's frame
  for (BenchLight& light : local)
    light.vector = light.kind == BenchLight::Kind::kPoint
                       ? object_from_world * light.vector
                       : Eigen::Vector3d((object_from_world.rotation * light.vector).normalized());

  const auto sent = [&](const EyeSample& sample) {
    const SurfacePoint surface = state_->mesh.at({sample.triangle, sample.u, sample.v});
    Eigen::Matrix3d local_from_object;
    local_from_object << surface.tangent.transpose(),
        surface.normal.cross(surface.tangent).transpose(), surface.normal.transpose();
    const Eigen::Vector2d uv = surface.uv.cwiseProduct(repeats);
    const auto texel_at = [](double coordinate, int size) {
      const double fraction = coordinate - std::floor(coordinate);
      return std::min(static_cast<int>(fraction * size), size - 1);
    };
    const int texel =
        texel_at(uv.y(), material.height) * material.width + texel_at(uv.x(), material.width);
    const Eigen::Vector3d to_eye =
        local_from_object * (view.eye_in_object - surface.position).normalized();
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    for (const BenchLight& light : local) {
      Eigen::Vector3d to_light = light.vector;
      Eigen::Vector3d illuminance = light.rgb;
      if (light.kind == BenchLight::Kind::kPoint) {
        to_light -= surface.position;
        illuminance /= to_light.squaredNorm();
        to_light.normalize();
      }
      const Eigen::Vector3d direction = local_from_object * to_light;
      if (direction.z() <= 0) continue;  // from within the object
      rgb += material.radiance(texel, to_eye, direction).cwiseProduct(illuminance);
    }
    return Eigen::Vector3d(rgb / std::numbers::pi);
  };

  Image<Rgb32f> picture(view.width(), view.height(), Rgb32f::Zero());
  parallel_for(view.height(), 1, [&](std::int64_t begin, std::int64_t end) {
    const auto width = static_cast<std::size_t>(view.width());
    for (std::size_t pixel = static_cast<std::size_t>(begin) * width;
         pixel < static_cast<std::size_t>(end) * width;
         ++pixel) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
        sum += sent(view.samples[i]);
      picture.pixels()[pixel] = (xyz_from_srgb() * sum / view.rays_per_pixel).cast<float>();
    }
  });
  return picture;
}

Xyz Bench::board(const Rgb16& code,
                 const Eigen::Vector2d& pixel,
                 double lamp,
                 bool of_object) const {
  const SurfaceLight& surface = of_object ? state_->on_object[0] : state_->on_white;
  const VirtualProjector& projector = state_->projector;
  const double cosine = projector.axis_cosine(pixel);
  const double distance = state_->truth.projector.reference_distance_m / cosine;
  const double fall_off = std::pow(state_->truth.projector.reference_distance_m / distance, 2);
  const double geometry = cosine * fall_off * projector.vignetting(pixel);
  return lamp * geometry * (surface.outputs * projector.output(code) + surface.black) +
         surface.ambient;
}

std::optional<EyeSample> Bench::trace(const RigidTransform& world_from_object,
                                      const Eigen::Vector3d& origin_in_world,
                                      const Eigen::Vector3d& direction_in_world) const {
  const RigidTransform object_from_world = world_from_object.inverse();
  const auto hit = state_->mesh.trace(object_from_world * origin_in_world,
                                      object_from_world.rotation * direction_in_world);
  if (!hit) return std::nullopt;
  const Eigen::Vector3d& lens = state_->truth.projector.world_from_projector.translation;
  return state_->light(*hit, world_from_object, object_from_world * lens);
}

std::optional<Eigen::Vector3d> Bench::lit_point(const RigidTransform& world_from_object,
                                                const Eigen::Vector2d& pixel) const {
  const ProjectorTruth& projector = state_->truth.projector;
  const Eigen::Vector2d slope =
      (pixel - projector.principal_point).cwiseQuotient(projector.focal_px);
  const RigidTransform object_from_projector =
      world_from_object.inverse() * projector.world_from_projector;
  const auto hit = state_->mesh.trace(object_from_projector.translation,
                                      object_from_projector.rotation * slope.homogeneous());
  if (!hit) return std::nullopt;
  return world_from_object * state_->mesh.at(*hit).position;
}

}  // namespace veneer::simulation
