// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/map_quality.h"

#include "base/statistics.h"
#include "calibration/maps/internal_map_texels.h"

namespace veneer::calibration {

Status MapOptions::check() const {
  if (width < 0 || height < 0 || (width == 0) != (height == 0))
    return fail(Errc::kInvalidOption,
                "the map's size {} x {} is not two positive numbers, nor 0 x 0 for the raster's",
                width,
                height);
  const auto in = [](double value, double low, double high) {
    return value >= low && value <= high;
  };
  constexpr double kMost = 1e9;
  if (!in(full_scale, 0, kMost))
    return fail(Errc::kInvalidOption, "full_scale {} is not 0 or more", full_scale);
  if (!in(least_confidence, 0, 1))
    return fail(Errc::kInvalidOption, "least_confidence {} is not from 0 to 1", least_confidence);
  if (!in(dark_noise, 0, kMost))
    return fail(Errc::kInvalidOption, "dark_noise {} is not 0 or more", dark_noise);
  if (!in(counts_per_electron, 0, kMost))
    return fail(
        Errc::kInvalidOption, "counts_per_electron {} is not 0 or more", counts_per_electron);
  if (!(least_light > 0 && least_light <= 1))
    return fail(Errc::kInvalidOption, "least_light {} is not above 0 and up to 1", least_light);
  if (!(most_noise > 0))
    return fail(Errc::kInvalidOption, "most_noise {} is not above 0", most_noise);
  if (!in(most_fill, 0, 1000))
    return fail(Errc::kInvalidOption, "most_fill {} is not from 0 to 1000", most_fill);
  return {};
}

namespace internal {

void sum_up(const std::function<bool(int x, int y)>& on_object,
            std::vector<double> pixels,
            MapQuality& quality) {
  std::int64_t object = 0;
  std::int64_t seen = 0;
  std::int64_t filled = 0;
  for (int y = 0; y < quality.source.height(); ++y)
    for (int x = 0; x < quality.source.width(); ++x) {
      const MapSource source = quality.source(x, y);
      if (source != MapSource::kSeen && !on_object(x, y)) continue;
      ++object;
      if (source == MapSource::kSeen) ++seen;
      if (source == MapSource::kFilled) ++filled;
    }
  if (object > 0) {
    quality.seen = static_cast<double>(seen) / static_cast<double>(object);
    quality.filled = static_cast<double>(filled) / static_cast<double>(object);
  }
  quality.pixels_per_texel = quantile(std::move(pixels), 0.5);
  constexpr double kLeastSeen = 0.7;
  constexpr double kCoarse = 1.5;
  if (quality.seen < kLeastSeen)
    quality.warnings.push_back(fmt::format(
        "the camera saw {:.0f} % of the object's texels; {}",
        100 * quality.seen,
        quality.pixels_per_texel < kCoarse
            ? "it is too coarse for so many of them: choose fewer texels or move it closer"
            : "move it so that it sees what the projector lights"));
  constexpr double kMostSaturated = 0.01;
  if (static_cast<double>(quality.saturated) > kMostSaturated * static_cast<double>(seen))
    quality.warnings.push_back(
        fmt::format("{} camera pixels were saturated; expose shorter", quality.saturated));
}

Status check_sizes(const ProjectorGeometry& raster,
                   ImageView<const Eigen::Vector2f> projector,
                   ImageView<const float> confidence,
                   std::initializer_list<ImageView<const Rgb16>> pictures) {
  if (raster.width <= 0 || raster.height <= 0)
    return fail(Errc::kInvalidOption, "the raster is {} x {} pixels", raster.width, raster.height);
  if (projector.empty())
    return fail(Errc::kInvalidOption, "there is no decoded picture to tell what lights a pixel");
  for (const auto& picture : pictures)
    if (picture.width() != projector.width() || picture.height() != projector.height())
      return fail(Errc::kInvalidOption,
                  "a picture is {} x {} pixels and the decoded one {} x {}; take them with one "
                  "camera that is not moved",
                  picture.width(),
                  picture.height(),
                  projector.width(),
                  projector.height());
  if (!confidence.empty() &&
      (confidence.width() != projector.width() || confidence.height() != projector.height()))
    return fail(Errc::kInvalidOption,
                "the confidence is {} x {} pixels and the decoded picture {} x {}",
                confidence.width(),
                confidence.height(),
                projector.width(),
                projector.height());
  return {};
}

Image<MapSource> no_source(const ProjectorGeometry& raster, const MapOptions& options) {
  return {options.width > 0 ? options.width : raster.width,
          options.height > 0 ? options.height : raster.height,
          MapSource::kNone};
}

}  // namespace internal
}  // namespace veneer::calibration
