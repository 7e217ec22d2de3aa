// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "simulation/bench.h"
#include "simulation/bench/state.h"

namespace veneer::simulation {
namespace {

DifferenceStatistics statistics_of(std::vector<double> de00) {
  if (de00.empty()) return {};
  std::ranges::sort(de00);
  const auto count = static_cast<double>(de00.size());
  DifferenceStatistics s;
  s.count = static_cast<std::int64_t>(de00.size());
  s.mean = std::accumulate(de00.begin(), de00.end(), 0.0) / count;
  s.p95 = de00[static_cast<std::size_t>(std::ceil(0.95 * count)) - 1];
  s.max = de00.back();
  return s;
}

double mean_geometry(const EyeView& view, std::size_t pixel) {
  double sum = 0;
  for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
    sum += view.samples[i].geometry;
  return sum / view.rays_per_pixel;
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
             (white.primaries * state_->projector.output({full, full, full}) + white.black));
}

bool Bench::reachable(const Xyz& xyz, double geometry) const {
  if (!(geometry > 0)) return false;
  const SurfaceLight& surface = state_->on_object;
  const Xyz from_channels = (xyz - surface.ambient) / geometry - surface.black;
  return state_->projector.drive_of(surface.primaries.inverse() * from_channels).has_value();
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
    if (coverage != Coverage::kCovered) continue;
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
    if (!reachable(wanted, mean_geometry(view, pixel))) continue;
    c.in_gamut.pixels()[pixel] = 1;
    within_gamut.push_back(de00);
  }
  if (!covered.empty())
    c.in_gamut_fraction =
        static_cast<double>(within_gamut.size()) / static_cast<double>(covered.size());
  c.covered = statistics_of(std::move(covered));
  c.within_gamut = statistics_of(std::move(within_gamut));
  return c;
}

}  // namespace veneer::simulation
