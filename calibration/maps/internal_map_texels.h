// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the maps through the camera have in common: from camera pixels to the texels of a map.

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/maps/map_quality.h"
#include "calibration/profile.h"

namespace veneer::calibration::internal {

/// Where on an image that is stretched over the raster a raster place lies; it is on the raster.
template <class Pixel>
Eigen::Vector2i texel_of(const Pixel& image,
                         const ProjectorGeometry& raster,
                         const Eigen::Vector2d& place) {
  const auto at = [](double coordinate, int extent, int texels) {
    return std::min(static_cast<int>(coordinate / extent * texels), texels - 1);
  };
  return {at(place.x(), raster.width, image.width()), at(place.y(), raster.height, image.height())};
}

/// What the camera counted at the places of one texel, or of some other area.
struct Sums {
  double counts = 0;    // above black
  double variance = 0;  // of `counts`
  double light = 0;     // that a surface of reflectance 1 would have got, in any unit
  int pixels = 0;

  void add(double more_counts, double more_variance, double more_light) {
    counts += more_counts;
    variance += more_variance;
    light += more_light;
    ++pixels;
  }
  [[nodiscard]] double value() const { return counts / light; }
  [[nodiscard]] double noise() const { return std::sqrt(variance) / light; }
};

/// The pixels of the camera that can be used, each with the raster place that lights it.
class PixelSieve {
 public:
  PixelSieve(ImageView<const Eigen::Vector2f> projector,
             ImageView<const float> confidence,
             const ProjectorGeometry& raster,
             const MapOptions& options,
             MapQuality& quality)
      : projector_(projector),
        confidence_(confidence),
        raster_(raster),
        options_(options),
        quality_(quality) {}

  /// Calls use(x, y, place) for every one. What use() finds to be off the object, or saturated, it
  /// counts itself.
  template <class Use>
  void for_each(const Use& use) const {
    for (int y = 0; y < projector_.height(); ++y)
      for (int x = 0; x < projector_.width(); ++x) {
        const Eigen::Vector2d place = projector_(x, y).template cast<double>();
        if (!place.allFinite()) continue;
        if (!confidence_.empty() && !(confidence_(x, y) >= options_.least_confidence)) {
          ++quality_.unsure;
          continue;
        }
        if (!(place.x() >= 0 && place.x() <= raster_.width && place.y() >= 0 &&
              place.y() <= raster_.height)) {
          ++quality_.stray;
          continue;
        }
        use(x, y, place);
      }
  }

  [[nodiscard]] bool saturated(double counts) const {
    return options_.full_scale > 0 && counts >= options_.full_scale;
  }
  /// Of the difference of two counts.
  [[nodiscard]] double variance(double lit, double unlit) const {
    return 2 * options_.dark_noise * options_.dark_noise +
           options_.counts_per_electron * (lit + unlit);
  }

 private:
  ImageView<const Eigen::Vector2f> projector_;
  ImageView<const float> confidence_;
  const ProjectorGeometry& raster_;
  const MapOptions& options_;
  MapQuality& quality_;
};

/// Fills texels without a source with the mean of the neighbours that have a value, ring by ring.
template <class Value>
void fill_holes(Image<Value>& map, Image<MapSource>& source, int most_fill) {
  for (int ring = 0; ring < most_fill; ++ring) {
    const Image<MapSource> before = source;
    bool changed = false;
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x) {
        if (before(x, y) != MapSource::kNone) continue;
        Value sum = black_pixel<Value>();
        int neighbours = 0;
        for (int v = std::max(0, y - 1); v <= std::min(map.height() - 1, y + 1); ++v)
          for (int u = std::max(0, x - 1); u <= std::min(map.width() - 1, x + 1); ++u)
            if (before(u, v) != MapSource::kNone) {
              sum += map(u, v);
              ++neighbours;
            }
        if (neighbours == 0) continue;
        map(x, y) = sum / static_cast<float>(neighbours);
        source(x, y) = MapSource::kFilled;
        changed = true;
      }
    if (!changed) return;
  }
}

/// Fills in what `quality` says of all texels, and its warnings.
/// @param on_object  whether a texel is.   @param pixels  of the camera in the texels that are
/// seen.
void sum_up(const std::function<bool(int x, int y)>& on_object,
            std::vector<double> pixels,
            MapQuality& quality);

/// That there is a raster, and that all pictures are of the size of the decoded one.
[[nodiscard]] Status check_sizes(const ProjectorGeometry& raster,
                                 ImageView<const Eigen::Vector2f> projector,
                                 ImageView<const float> confidence,
                                 std::initializer_list<ImageView<const Rgb16>> pictures);

/// As large as the options say, kNone everywhere.
[[nodiscard]] Image<MapSource> no_source(const ProjectorGeometry& raster,
                                         const MapOptions& options);

}  // namespace veneer::calibration::internal
