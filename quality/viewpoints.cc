// SPDX-License-Identifier: Apache-2.0
#include "quality/viewpoints.h"

#include <cmath>

namespace veneer::quality {
namespace {

// Additive recurrences on the powers of the plastic number's kin in three dimensions, which fill a
// cube evenly however many points are taken (Roberts 2018, "The Unreasonable Effectiveness of
// Quasirandom Sequences").
constexpr double kRoot = 1.22074408460575947536;  // of x^4 = x + 1
double along(int index, int power) {
  const double x = 0.5 + index * std::pow(kRoot, -power);
  return x - std::floor(x);
}

}  // namespace

Result<std::vector<Viewpoint>> viewpoints_of(const render::Scene& scene, int count) {
  if (count < 1)
    return fail(Errc::kInvalidOption, "choosing viewpoints: {} are too few; take 1 or more", count);
  if (!scene.observer_region)
    return fail(Errc::kInvalidOption,
                "choosing viewpoints: the scene does not say where the observer may be; add "
                "[observer.region] with centre, radius_m, azimuth_deg and elevation_deg to it");
  std::vector<Viewpoint> viewpoints;
  for (int i = 0; i < count; ++i)
    viewpoints.push_back(
        {render::point_in(*scene.observer_region, {along(i, 1), along(i, 2), along(i, 3)}),
         scene.world_from_object});
  return viewpoints;
}

}  // namespace veneer::quality
