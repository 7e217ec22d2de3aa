// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "simulation/bench.h"
#include "simulation/bench/state.h"

namespace veneer::simulation {
namespace {

DifferenceStatistics statistics_of(const std::vector<double>& de00) {
  return {static_cast<std::int64_t>(de00.size()),
          mean(de00),
          quantile(de00, 0.95),
          quantile(de00, 1.0)};
}

double mean_geometry(const EyeView& view, std::size_t pixel) {
  double sum = 0;
  for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
    sum += view.samples[i].geometry;
  return sum / view.rays_per_pixel;
}

/// @param painted_lit, painted_seen  part of `painted` in the projector's light and in the ambient.
SurfaceLight mixed(const SurfaceLight& bare,
                   const SurfaceLight& painted,
                   double painted_lit,
                   double painted_seen) {
  return {(1 - painted_lit) * bare.outputs + painted_lit * painted.outputs,
          (1 - painted_lit) * bare.black + painted_lit * painted.black,
          (1 - painted_seen) * bare.ambient + painted_seen * painted.ambient};
}

/// What a pixel sees of a surface of two reflectances.
SurfaceLight mean_surface(const EyeView& view,
                          std::size_t pixel,
                          const std::array<SurfaceLight, 2>& on_object) {
  double geometry = 0;
  double painted_geometry = 0;
  double painted_rays = 0;
  for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i) {
    const EyeSample& sample = view.samples[i];
    geometry += sample.geometry;
    if (!sample.painted) continue;
    painted_geometry += sample.geometry;
    ++painted_rays;
  }
  const double rays = view.first[pixel + 1] - view.first[pixel];
  return mixed(on_object[0],
               on_object[1],
               geometry > 0 ? painted_geometry / geometry : 0.0,
               rays > 0 ? painted_rays / rays : 0.0);
}

}  // namespace

Result<Xyz> Bench::white(const RigidTransform& world_from_object) const {
  const ProjectorTruth& truth = state_->truth.projector;
  const Eigen::Vector3d origin =
      truth.world_from_projector.inverse() * world_from_object.translation;
  if (!(origin.z() > 0))
    return fail(
        Errc::kInvalidOption,
        "finding the white of colour differences: the object's origin is not in front of the "
        "projector; move the object or the projector");
  const Eigen::Vector2d pixel =
      (truth.focal_px.cwiseProduct(origin.head<2>() / origin.z()) + truth.principal_point)
          .cwiseMax(0.0)
          .cwiseMin(Eigen::Vector2d(truth.width, truth.height));
  const double geometry =
      std::pow(truth.reference_distance_m / origin.norm(), 2) * state_->projector.vignetting(pixel);
  const auto full = static_cast<std::uint16_t>((1 << truth.bits) - 1);
  const SurfaceLight& white = state_->on_white;
  return Xyz(geometry *
             (white.outputs * state_->projector.output({full, full, full}) + white.black));
}

bool Bench::State::reachable(const SurfaceLight& surface, const Xyz& xyz, double geometry) const {
  if (!(geometry >= 0) || !xyz.allFinite()) return false;
  constexpr double kRounding = 1e-5;  // of pictures kept in 32-bit floats, with room to spare
  const double tolerance = kRounding * xyz.cwiseAbs().maxCoeff();
  // Held against the light, not the drive: where G is small, a rounding of xyz is any drive.
  const auto sends = [&](const VirtualProjector::Outputs& output) {
    const Xyz sent = geometry * (surface.outputs * output + surface.black) + surface.ambient;
    // False for NaN, which is what `output` is where dividing by a tiny G overflows.
    return ((sent - xyz).cwiseAbs().array() <= tolerance).all();
  };
  if (sends(VirtualProjector::Outputs::Zero())) return true;
  if (geometry == 0) return false;
  const Xyz from_channels = (xyz - surface.ambient) / geometry - surface.black;
  return sends(projector.interact(projector.drive_towards(surface.outputs, from_channels)));
}

bool Bench::reachable(const Xyz& xyz, double geometry, double painted) const {
  const auto& [bare, paint] = state_->on_object;
  return state_->reachable(mixed(bare, paint, painted, painted), xyz, geometry);
}

Result<Comparison> Bench::compare(const EyeView& view,
                                  const Image<Rgb32f>& target,
                                  const Image<Rgb32f>& received) const {
  for (const Image<Rgb32f>* image : {&target, &received})
    if (image->width() != view.width() || image->height() != view.height())
      return fail(Errc::kInvalidOption,
                  "comparing the eye's pictures: one has {} x {} pixels, the view {} x {}",
                  image->width(),
                  image->height(),
                  view.width(),
                  view.height());

  Comparison c;
  VENEER_ASSIGN(c.white, white(view.world_from_object));
  c.de00 = Image<float>(view.width(), view.height(), std::numeric_limits<float>::quiet_NaN());
  c.in_gamut = Image<std::uint8_t>(view.width(), view.height());
  std::vector<double> covered;
  std::vector<double> within_gamut;
  for (std::size_t pixel = 0; pixel < c.de00.pixels().size(); ++pixel) {
    const Coverage coverage = view.coverage.pixels()[pixel];
    if (coverage == Coverage::kPartial) ++c.partial;
    if (coverage == Coverage::kUnlit) ++c.unlit;
    if (coverage != Coverage::kCovered && coverage != Coverage::kUnlit) continue;
    const Xyz wanted = target.pixels()[pixel].cast<double>();
    const Xyz got = received.pixels()[pixel].cast<double>();
    if (!wanted.allFinite() || !got.allFinite())
      return fail(Errc::kBadFormat,
                  "comparing the eye's pictures: the light of pixel {}, {} is not finite",
                  pixel % static_cast<std::size_t>(view.width()),
                  pixel / static_cast<std::size_t>(view.width()));
    const Lab wanted_lab = lab_from_xyz(wanted, c.white);
    const Lab got_lab = lab_from_xyz(got, c.white);
    const double de00 = delta_e_2000(wanted_lab, got_lab);
    c.de00.pixels()[pixel] = static_cast<float>(de00);
    covered.push_back(de00);
    if (wanted_lab.l > 100) ++c.target_over_white;
    if (got_lab.l > 100) ++c.received_over_white;
    if (!state_->reachable(
            mean_surface(view, pixel, state_->on_object), wanted, mean_geometry(view, pixel)))
      continue;
    c.in_gamut.pixels()[pixel] = 1;
    within_gamut.push_back(de00);
  }
  if (!covered.empty())
    c.in_gamut_fraction =
        static_cast<double>(within_gamut.size()) / static_cast<double>(covered.size());
  c.covered = statistics_of(covered);
  c.within_gamut = statistics_of(within_gamut);
  return c;
}

}  // namespace veneer::simulation
