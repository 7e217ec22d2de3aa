// SPDX-License-Identifier: Apache-2.0
#include "btf/held_out.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "btf/mapped_material.h"
#include "btf/spread_texels.h"

namespace veneer::btf {
namespace {

// The exponent of the literature's tables.
constexpr double kEncodingExponent = 1.0 / 2.2;
constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

double cut(double sample) { return std::clamp(sample, 0.0, 1.0); }

// Of one texel, or of several.
struct Sums {
  double squares = 0.0;  // of linear differences
  double encoded = 0.0;  // |difference|
  bool finite = true;

  void add(double drawn, double measured) {
    finite = finite && std::isfinite(drawn) && std::isfinite(measured);
    const double a = cut(drawn);
    const double b = cut(measured);
    squares += (a - b) * (a - b);
    encoded += std::abs(std::pow(a, kEncodingExponent) - std::pow(b, kEncodingExponent));
  }
  void add(const Sums& other) {
    squares += other.squares;
    encoded += other.encoded;
    finite = finite && other.finite;
  }
};

// For every view whether it lies beyond the angle. Refuses an angle that all views are on one side
// of.
Result<std::vector<bool>> views_beyond(const SampleSet& set, double most_theta_rad) {
  const std::string doing = fmt::format("holding out the views of {} beyond {:.6g} degrees",
                                        set.path().string(),
                                        most_theta_rad * kDegreesPerRadian);
  if (!(most_theta_rad >= 0.0 && most_theta_rad <= std::numbers::pi / 2.0))
    return fail(Errc::kInvalidOption, "{}: the angle must lie between 0 and 90 degrees", doing);
  std::vector<bool> beyond;
  double nearest_rad = std::numbers::pi;
  double furthest_rad = 0.0;
  for (const Direction& view : set.info().views) {
    const double theta_rad = angles_from_direction(view).theta;
    nearest_rad = std::min(nearest_rad, theta_rad);
    furthest_rad = std::max(furthest_rad, theta_rad);
    beyond.push_back(theta_rad > most_theta_rad + kViewSlack_rad);
  }
  const auto count = std::ranges::count(beyond, true);
  if (count == 0)
    return fail(Errc::kInvalidOption,
                "{}: there are none, the furthest from the normal is at {:.6g}; give an angle "
                "below that",
                doing,
                furthest_rad * kDegreesPerRadian);
  if (count == std::ssize(beyond))
    return fail(Errc::kInvalidOption,
                "{}: no view would be left to fit, the nearest to the normal is at {:.6g}; give "
                "no smaller an angle",
                doing,
                nearest_rad * kDegreesPerRadian);
  return beyond;
}

ViewsError error_of(const Sums& sums, std::int64_t views, double samples_per_view) {
  const double count = static_cast<double>(views) * samples_per_view;
  return {static_cast<int>(views), std::sqrt(sums.squares / count), sums.encoded / count};
}

}  // namespace

Result<SampleSet> without_views_beyond(const SampleSet& set,
                                       double most_theta_rad,
                                       const std::filesystem::path& folder) {
  VENEER_ASSIGN(const std::vector<bool> beyond, views_beyond(set, most_theta_rad));
  SampleSetInfo info = set.info();
  info.views.clear();
  for (std::size_t view = 0; view < beyond.size(); ++view)
    if (!beyond[view]) info.views.push_back(set.info().views[view]);
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(folder, info));
  const std::size_t row = info.lights.size() * static_cast<std::size_t>(info.channel_count());
  for (int texel = 0; texel < info.texel_count(); ++texel) {
    const auto from = set.stored(texel);
    auto to = writer.texel(texel).begin();
    for (std::size_t view = 0; view < beyond.size(); ++view)
      if (!beyond[view]) to = std::ranges::copy(from.subspan(view * row, row), to).out;
  }
  VENEER_TRY(writer.finish());
  return SampleSet::open(folder);
}

Result<HeldOutErrors> held_out_errors(const SampleSet& set,
                                      const Material& material,
                                      double most_theta_rad,
                                      int most_texels,
                                      Progress& progress) {
  const SampleSetInfo& info = set.info();
  const std::string doing =
      fmt::format("comparing views of {} that no fit saw", set.path().string());
  VENEER_ASSIGN(const std::vector<bool> beyond, views_beyond(set, most_theta_rad));
  VENEER_TRY(refuse_texel_map(material, Errc::kBadFormat, doing));
  if (material.width() != info.width || material.height() != info.height)
    return fail(Errc::kBadFormat,
                "{}: the material has {} x {} texels, the set {} x {}; fit it on views of this set",
                doing,
                material.width(),
                material.height(),
                info.width,
                info.height);
  if (most_texels < 1)
    return fail(Errc::kInvalidOption, "{}: {} texels; compare 1 at least", doing, most_texels);

  const std::vector<int> texels = spread_texels(info, most_texels);
  std::vector<std::array<Sums, 2>> of_texels(texels.size());  // within, beyond
  progress.start("comparing held-out views", std::ssize(texels));
  parallel_for(std::ssize(texels), 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
    for (std::int64_t i = begin; i < end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      set.rgb(texels[at], Part::kTotal, rgb);
      auto measured = rgb.cbegin();
      for (std::size_t view = 0; view < beyond.size(); ++view) {
        Sums& sums = of_texels[at][beyond[view] ? 1 : 0];
        for (const Direction& light : info.lights) {
          const Eigen::Vector3d drawn = material.radiance(texels[at], info.views[view], light);
          for (const double channel : drawn) sums.add(channel, static_cast<double>(*measured++));
        }
      }
      progress.advance();
    }
  });

  // Each texel by itself and then in order, so that rounding does not depend on threads.
  std::array<Sums, 2> sums;
  for (std::size_t i = 0; i < texels.size(); ++i) {
    for (std::size_t side = 0; side < 2; ++side) sums[side].add(of_texels[i][side]);
    if (!sums[0].finite || !sums[1].finite)
      return fail(Errc::kBadFormat,
                  "{}: texel {} holds NaN or infinite values, of the set or of the material {}; "
                  "import or fit it again",
                  doing,
                  texels[i],
                  material.model());
  }
  const double per_view = static_cast<double>(texels.size() * info.lights.size() * 3);
  const std::int64_t held_out = std::ranges::count(beyond, true);
  return HeldOutErrors{error_of(sums[0], std::ssize(beyond) - held_out, per_view),
                       error_of(sums[1], held_out, per_view),
                       static_cast<int>(texels.size())};
}

}  // namespace veneer::btf
