// SPDX-License-Identifier: Apache-2.0
#include "quality/viewpoints.h"

#include "quality/low_discrepancy.h"

namespace veneer::quality {

Result<std::vector<Viewpoint>> viewpoints_of(const render::Scene& scene, int count) {
  if (count < 1)
    return fail(Errc::kInvalidOption, "choosing viewpoints: {} are too few; take 1 or more", count);
  if (!scene.observer_region)
    return fail(Errc::kInvalidOption,
                "choosing viewpoints: the scene does not say where the observer may be; add "
                "[observer.region] with centre, radius_m, azimuth_deg and elevation_deg to it");
  const LowDiscrepancy<3> sequence;
  std::vector<Viewpoint> viewpoints;
  for (int i = 0; i < count; ++i) {
    const auto at = sequence(static_cast<std::size_t>(i));
    viewpoints.push_back(
        {render::point_in(*scene.observer_region, {at[0], at[1], at[2]}), scene.world_from_object});
  }
  return viewpoints;
}

}  // namespace veneer::quality
