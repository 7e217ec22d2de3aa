// SPDX-License-Identifier: Apache-2.0
#include "btf/fixed_directions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {
namespace {

// How far beyond the border of the data a direction may lie: rounding, and hands that type degrees.
constexpr double kBorder = 1e-3;  // radians
// Weights under this are a measured direction's rounding.
constexpr double kRounding = 1e-9;

struct Share {
  std::size_t index;
  float weight;
};
// What makes each direction of the new set, from those of the old.
using Mixture = std::vector<std::vector<Share>>;

Mixture unchanged(const DirectionSet& directions) {
  Mixture mixture;
  for (std::size_t i = 0; i < directions.size(); ++i) mixture.push_back({{i, 1.0F}});
  return mixture;
}

std::string degrees(const Direction& direction) {
  const Angles angles = angles_from_direction(direction);
  constexpr double kDegree = 180.0 / std::numbers::pi;
  return fmt::format("{:.6g},{:.6g}", angles.theta * kDegree, angles.phi * kDegree);
}

Result<Mixture> mixture_at(const DirectionSet& measured,
                           const Direction& fixed,
                           std::string_view what,
                           const std::filesystem::path& path) {
  if (!(std::abs(fixed.norm() - 1.0) <= kBorder))
    return fail(Errc::kInvalidOption,
                "fixing the {} of {}: not a direction; give its theta and phi",
                what,
                path.string());
  const DirectionWeights at = SphericalInterpolator(measured, DirectionRole::kView).weights(fixed);
  Direction met = Direction::Zero();
  for (std::size_t i = 0; i < 3; ++i)
    met += at.weight[i] * measured[static_cast<std::size_t>(at.index[i])];
  // Beyond the data the weights are those of the border, and point there.
  if (!((met.normalized() - fixed).norm() <= kBorder))
    return fail(
        Errc::kInvalidOption,
        "fixing the {} of {}: {} degrees lies beyond its measured {}s, whose border at this "
        "azimuth is {}; choose one among them",
        what,
        path.string(),
        degrees(fixed),
        what,
        degrees(met));
  std::vector<Share> shares;
  for (std::size_t i = 0; i < 3; ++i)
    if (at.weight[i] > kRounding)
      shares.push_back({static_cast<std::size_t>(at.index[i]), static_cast<float>(at.weight[i])});
  if (shares.size() == 1) shares.front().weight = 1.0F;
  return Mixture{std::move(shares)};
}

}  // namespace

Result<SampleSet> fix_directions(const SampleSet& set,
                                 const FixedDirections& fixed,
                                 const std::filesystem::path& folder,
                                 Progress& progress) {
  if (!fixed.view && !fixed.light)
    return fail(Errc::kInvalidOption, "fixing directions: neither a view nor a light is given");
  const SampleSetInfo& old = set.info();
  SampleSetInfo info = old;
  Mixture views = unchanged(old.views);
  Mixture lights = unchanged(old.lights);
  if (fixed.view) {
    VENEER_ASSIGN(views, mixture_at(old.views, *fixed.view, "view", set.path()));
    info.views = {*fixed.view};
    info.source += fmt::format("; seen from {} degrees", degrees(*fixed.view));
  }
  if (fixed.light) {
    VENEER_ASSIGN(lights, mixture_at(old.lights, *fixed.light, "light", set.path()));
    info.lights = {*fixed.light};
    info.source += fmt::format("; lit from {} degrees", degrees(*fixed.light));
  }
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(folder, info));
  const auto channels = static_cast<std::size_t>(info.channel_count());
  progress.start("fixed directions", info.texel_count());
  parallel_for(info.texel_count(), 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      const std::span<const Eigen::half> from = set.stored(texel);
      auto to = writer.texel(texel).begin();
      for (const std::vector<Share>& view : views)
        for (const std::vector<Share>& light : lights)
          for (std::size_t channel = 0; channel < channels; ++channel) {
            float sum = 0.0F;
            for (const Share& v : view)
              for (const Share& l : light)
                sum += v.weight * l.weight *
                       static_cast<float>(
                           from[(v.index * old.lights.size() + l.index) * channels + channel]);
            *to++ = static_cast<Eigen::half>(sum);
          }
    }
    progress.advance(end - begin);
  });
  progress.finish({});
  VENEER_TRY(writer.finish());
  return SampleSet::open(folder);
}

}  // namespace veneer::btf
