// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/surface_map.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "calibration/maps/internal_map_texels.h"

namespace veneer::calibration {
namespace {

using namespace internal;  // NOLINT(google-build-using-namespace): ours, of this folder

/// Camera pixels that the reference place needs: its noise is in every value of the map.
constexpr int kLeastReferencePixels = 8;
/// Light at the reference place in standard deviations of its noise, at least.
constexpr double kLeastReferenceLight = 20;
constexpr std::array<std::string_view, 3> kPrimaryNames{"red", "green", "blue"};

/// For each primary the camera's channel that counts it strongest.
std::array<int, 3> strongest_channels(const SurfacePictures& pictures, const PixelSieve& sieve) {
  std::array<Eigen::Array3d, 3> counts{
      Eigen::Array3d::Zero(), Eigen::Array3d::Zero(), Eigen::Array3d::Zero()};
  sieve.for_each([&](int x, int y, const Eigen::Vector2d&) {
    for (std::size_t primary = 0; primary < 3; ++primary)
      for (std::size_t c = 0; c < 3; ++c)
        counts[primary][static_cast<Eigen::Index>(c)] +=
            static_cast<double>(pictures.primaries[primary](x, y)[c]) -
            static_cast<double>(pictures.blacks[primary](x, y)[c]);
  });
  std::array<int, 3> channels{};
  for (std::size_t primary = 0; primary < 3; ++primary)
    counts[primary].maxCoeff(&channels[primary]);
  return channels;
}

/// The map in the making: every texel's sums, and those of the reference place.
class SurfaceMeasurement {
 public:
  SurfaceMeasurement(const SurfacePictures& pictures,
                     ImageView<const float> form_factor,
                     const ProjectorProfile& profile,
                     const CameraFallOff& camera,
                     const MapOptions& options)
      : pictures_(pictures),
        form_factor_(form_factor),
        profile_(profile),
        camera_(camera),
        options_(options) {
    result_.quality.source = no_source(profile.geometry, options);
  }

  Result<SurfaceMap> run(const Eigen::Vector2d& reference, double radius_px) {
    gather(reference, radius_px);
    VENEER_TRY(check_reference(reference));
    draw();
    return std::move(result_);
  }

 private:
  void gather(const Eigen::Vector2d& reference, double radius_px) {
    MapQuality& quality = result_.quality;
    MapQuality not_counted;  // the pixels are gone through twice
    result_.channels = strongest_channels(
        pictures_,
        {pictures_.projector, pictures_.confidence, profile_.geometry, options_, not_counted});
    for (Image<Sums>& sums : texels_)
      sums = Image<Sums>(quality.source.width(), quality.source.height());
    const PixelSieve sieve(
        pictures_.projector, pictures_.confidence, profile_.geometry, options_, quality);
    sieve.for_each([&](int x, int y, const Eigen::Vector2d& place) {
      const Eigen::Vector2i at = texel_of(form_factor_, profile_.geometry, place);
      const double light = form_factor_(at.x(), at.y()) * profile_.vignetting_at(place) *
                           camera_({x + 0.5, y + 0.5});
      if (!(light > 0)) {
        ++quality.stray;
        return;
      }
      std::array<double, 3> lit{};
      std::array<double, 3> unlit{};
      bool saturated = false;
      for (std::size_t primary = 0; primary < 3; ++primary) {
        const auto c = static_cast<std::size_t>(result_.channels[primary]);
        lit[primary] = pictures_.primaries[primary](x, y)[c];
        unlit[primary] = pictures_.blacks[primary](x, y)[c];
        saturated |= sieve.saturated(lit[primary]) || sieve.saturated(unlit[primary]);
      }
      if (saturated) {
        ++quality.saturated;
        return;
      }
      const Eigen::Vector2i texel = texel_of(quality.source, profile_.geometry, place);
      const bool at_reference = (place - reference).norm() <= radius_px;
      for (std::size_t primary = 0; primary < 3; ++primary) {
        const double counts = lit[primary] - unlit[primary];
        const double variance = sieve.variance(lit[primary], unlit[primary]);
        texels_[primary](texel.x(), texel.y()).add(counts, variance, light);
        if (at_reference) reference_[primary].add(counts, variance, light);
      }
    });
  }

  Status check_reference(const Eigen::Vector2d& place) {
    for (std::size_t primary = 0; primary < 3; ++primary) {
      const Sums& sums = reference_[primary];
      if (sums.pixels < kLeastReferencePixels)
        return fail(Errc::kBadFormat,
                    "measuring the surface's map: {} camera pixels are sure and not saturated at "
                    "the reference place, pixel {:.0f}, {:.0f} of the raster, and {} are needed; "
                    "choose a place that camera and projector see, or a larger radius",
                    sums.pixels,
                    place.x(),
                    place.y(),
                    kLeastReferencePixels);
      if (!(sums.counts > kLeastReferenceLight * std::sqrt(sums.variance)) || !(sums.counts > 0))
        return fail(Errc::kBadFormat,
                    "measuring the surface's map: full {} gives {:.3g} counts a pixel above black "
                    "at the reference place, which is lost in the noise; expose longer or choose a "
                    "brighter place",
                    kPrimaryNames[primary],
                    sums.counts / sums.pixels);
      result_.reference_noise[static_cast<Eigen::Index>(primary)] =
          std::sqrt(sums.variance) / sums.counts;
    }
    return {};
  }

  void draw() {
    MapQuality& quality = result_.quality;
    const int width = quality.source.width();
    const int height = quality.source.height();
    result_.map = Image<Rgb32f>(width, height, Rgb32f::Ones());
    result_.noise = Image<Rgb32f>(width, height);
    const double least_light =
        options_.least_light * reference_[0].light / reference_[0].pixels;  // a pixel
    std::vector<double> pixels;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const Sums& any = texels_[0](x, y);
        if (any.pixels == 0 || any.light < least_light * any.pixels) continue;
        Eigen::Vector3d value;
        Eigen::Vector3d noise;
        for (std::size_t primary = 0; primary < 3; ++primary) {
          const Sums& sums = texels_[primary](x, y);
          const auto c = static_cast<Eigen::Index>(primary);
          value[c] = sums.value() / reference_[primary].value();
          noise[c] = sums.noise() / reference_[primary].value();
        }
        if (!(noise.maxCoeff() <= options_.most_noise)) continue;
        // What is less than its noise, or below zero, is no smaller reflectance than that.
        constexpr double kLeast = kLeastReflectance;
        result_.map(x, y) = value.cwiseMax(noise)
                                .cwiseMax(kLeast)
                                .cast<float>()
                                .cwiseMax(kLeastReflectance)
                                .cwiseMin(1.0F / kLeastReflectance);
        result_.noise(x, y) = noise.cast<float>();
        quality.source(x, y) = MapSource::kSeen;
        pixels.push_back(any.pixels);
      }
    fill_holes(result_.map, quality.source, options_.most_fill);
    const ProjectorGeometry& raster = profile_.geometry;
    const auto on_object = [&](int x, int y) {
      const Eigen::Vector2d centre((x + 0.5) / width * raster.width,
                                   (y + 0.5) / height * raster.height);
      const Eigen::Vector2i at = texel_of(form_factor_, raster, centre);
      return form_factor_(at.x(), at.y()) > 0;
    };
    sum_up(on_object, std::move(pixels), quality);
  }

  const SurfacePictures& pictures_;
  ImageView<const float> form_factor_;
  const ProjectorProfile& profile_;
  const CameraFallOff& camera_;
  const MapOptions& options_;
  SurfaceMap result_;
  std::array<Image<Sums>, 3> texels_;
  std::array<Sums, 3> reference_;
};

}  // namespace

Result<SurfaceMap> measure_surface_map(const SurfacePictures& pictures,
                                       ImageView<const float> form_factor,
                                       const ProjectorProfile& profile,
                                       const CameraFallOff& camera,
                                       const Eigen::Vector2d& reference,
                                       double reference_radius_px,
                                       const MapOptions& options) {
  constexpr std::string_view kDoing = "measuring the surface's map";
  if (const Status valid = options.check(); !valid) return fail_while(kDoing, valid.error());
  const auto& p = pictures;
  if (const Status valid = check_sizes(
          profile.geometry,
          p.projector,
          p.confidence,
          {p.primaries[0], p.primaries[1], p.primaries[2], p.blacks[0], p.blacks[1], p.blacks[2]});
      !valid)
    return fail_while(kDoing, valid.error());
  if (form_factor.empty())
    return fail(
        Errc::kInvalidOption,
        "{}: there is no form factor; give the one of the mesh, or measure it on the object "
        "while it is white",
        kDoing);
  if (!reference.allFinite() || !(reference_radius_px > 0))
    return fail(Errc::kInvalidOption,
                "{}: the reference place {}, {} or its radius {} is no place on the raster",
                kDoing,
                reference.x(),
                reference.y(),
                reference_radius_px);
  return SurfaceMeasurement(pictures, form_factor, profile, camera, options)
      .run(reference, reference_radius_px);
}

}  // namespace veneer::calibration
