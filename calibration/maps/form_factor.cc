// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/form_factor.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "calibration/maps/internal_map_texels.h"

namespace veneer::calibration {

using namespace internal;  // NOLINT(google-build-using-namespace): ours, of this folder

namespace {

/// Takes back what was filled in past the object's rim: a hole has texels that were seen on all
/// four sides of it.
void open_rims(int most_fill, FormFactorMap& result) {
  Image<MapSource>& source = result.quality.source;
  const auto seen_from = [&](int x, int y, int step_x, int step_y) {
    // Two holes' depths: from one border of it to the other.
    for (int step = 0; step < 2 * most_fill; ++step) {
      x += step_x;
      y += step_y;
      if (x < 0 || y < 0 || x >= source.width() || y >= source.height()) return false;
      if (source(x, y) == MapSource::kSeen) return true;
    }
    return false;
  };
  for (int y = 0; y < source.height(); ++y)
    for (int x = 0; x < source.width(); ++x) {
      if (source(x, y) != MapSource::kFilled) continue;
      if (seen_from(x, y, -1, 0) && seen_from(x, y, 1, 0) && seen_from(x, y, 0, -1) &&
          seen_from(x, y, 0, 1))
        continue;
      source(x, y) = MapSource::kNone;
      result.map(x, y) = 0;
    }
}

}  // namespace

Result<FormFactorMap> measure_form_factor(ImageView<const Rgb16> white,
                                          ImageView<const Rgb16> black,
                                          ImageView<const Eigen::Vector2f> projector,
                                          ImageView<const float> confidence,
                                          const ProjectorProfile& profile,
                                          const CameraFallOff& camera,
                                          double reference_counts,
                                          const MapOptions& options) {
  constexpr std::string_view kDoing = "measuring the form factor";
  if (const Status valid = options.check(); !valid) return fail_while(kDoing, valid.error());
  if (const Status valid = check_sizes(profile.geometry, projector, confidence, {white, black});
      !valid)
    return fail_while(kDoing, valid.error());
  if (!(reference_counts > 0 && std::isfinite(reference_counts)))
    return fail(Errc::kInvalidOption,
                "{}: the reference counts {} are not above 0",
                kDoing,
                reference_counts);

  FormFactorMap result;
  MapQuality& quality = result.quality;
  quality.source = no_source(profile.geometry, options);
  const int width = quality.source.width();
  const int height = quality.source.height();
  Image<Sums> texels(width, height);
  const PixelSieve sieve(projector, confidence, profile.geometry, options, quality);
  sieve.for_each([&](int x, int y, const Eigen::Vector2d& place) {
    double counts = 0;
    double variance = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double lit = white(x, y)[c];
      const double unlit = black(x, y)[c];
      if (sieve.saturated(lit) || sieve.saturated(unlit)) {
        ++quality.saturated;
        return;
      }
      counts += lit - unlit;
      variance += sieve.variance(lit, unlit);
    }
    const Eigen::Vector2i texel = texel_of(quality.source, profile.geometry, place);
    texels(texel.x(), texel.y())
        .add(counts, variance, profile.vignetting_at(place) * camera({x + 0.5, y + 0.5}));
  });

  result.map = Image<float>(width, height);
  result.noise = Image<float>(width, height);
  std::vector<double> pixels;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Sums& sums = texels(x, y);
      if (sums.pixels == 0 || !(sums.light > 0)) continue;
      const double noise = sums.noise() / reference_counts;
      if (!(noise <= options.most_noise)) continue;
      result.map(x, y) = static_cast<float>(std::max(sums.value() / reference_counts, 0.0));
      result.noise(x, y) = static_cast<float>(noise);
      quality.source(x, y) = MapSource::kSeen;
      pixels.push_back(sums.pixels);
    }
  if (pixels.empty())
    return fail(Errc::kBadFormat,
                "{}: the camera saw nothing of the object surely ({} pixels saturated, {} unsure, "
                "{} off the raster); check its exposure and where it looks",
                kDoing,
                quality.saturated,
                quality.unsure,
                quality.stray);
  fill_holes(result.map, quality.source, options.most_fill);
  open_rims(options.most_fill, result);
  sum_up([&](int x, int y) { return quality.source(x, y) != MapSource::kNone; },
         std::move(pixels),
         quality);
  return result;
}

}  // namespace veneer::calibration
