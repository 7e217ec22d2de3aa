// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/height_field.h"

#include <algorithm>
#include <cmath>

namespace veneer::simulation {

namespace {

// More relief than this is no longer a surface that a mean plane describes.
constexpr float kMaxHeight = 4.0F;  // tile widths

bool is_share(const Eigen::Vector3f& rgb) {
  // All comparisons with NaN are false, so a NaN is no share.
  return (rgb.array() >= 0.0F).all() && (rgb.array() <= 1.0F).all();
}

}  // namespace

Status HeightField::check() const {
  if (resolution < 1) {
    return fail(
        Errc::kInvalidOption, "checking a height field: resolution {} is not positive", resolution);
  }
  const auto cells = static_cast<std::size_t>(resolution) * static_cast<std::size_t>(resolution);
  if (heights.size() != cells || surfaces.size() != cells) {
    return fail(Errc::kInvalidOption,
                "checking a height field: {} heights and {} surfaces do not match {} x {} cells",
                heights.size(),
                surfaces.size(),
                resolution,
                resolution);
  }
  if (!(tile_width_mm > 0.0) || !std::isfinite(tile_width_mm)) {
    return fail(Errc::kInvalidOption,
                "checking a height field: tile width {} mm is not a positive number",
                tile_width_mm);
  }
  const auto bad_height =
      std::ranges::find_if(heights, [](float h) { return !(std::abs(h) <= kMaxHeight); });
  if (bad_height != heights.end()) {
    return fail(Errc::kInvalidOption,
                "checking a height field: height {} of corner {} is not within {} tile widths",
                *bad_height,
                bad_height - heights.begin(),
                kMaxHeight);
  }
  const auto bad_surface = std::ranges::find_if(surfaces, [](const Surface& s) {
    return !is_share(s.albedo) || !is_share(s.f0) || !(s.alpha >= 0.03F && s.alpha <= 1.0F);
  });
  if (bad_surface != surfaces.end()) {
    return fail(
        Errc::kInvalidOption,
        "checking a height field: the surface of cell {} has an albedo or f0 outside [0, 1] or an "
        "alpha outside [0.03, 1]",
        bad_surface - surfaces.begin());
  }
  return {};
}

HeightField flat_field(int resolution, const Surface& surface) {
  HeightField field;
  field.resolution = resolution;
  const auto cells = static_cast<std::size_t>(resolution) * static_cast<std::size_t>(resolution);
  field.heights.assign(cells, 0.0F);
  field.surfaces.assign(cells, surface);
  return field;
}

}  // namespace veneer::simulation
