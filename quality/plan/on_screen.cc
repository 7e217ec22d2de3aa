// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/on_screen.h"

#include <optional>

#include "quality/viewpoints.h"

namespace veneer::quality {

Status measure_plan_on_screen(Plan& plan,
                              const btf::InterpolatedSet& set,
                              const render::Scene& scene,
                              const calibration::ProjectorProfile& profile,
                              Progress& progress) {
  VENEER_ASSIGN(std::vector<Viewpoint> places, viewpoints_of(scene, kPlanViews));
  ScreenReferenceOptions options;
  options.pixels = kPlanPixels;
  VENEER_ASSIGN(const ScreenReference reference,
                ScreenReference::make(scene, profile, set, std::move(places), options, progress));
  std::vector<PlannedFit*> fits{&plan.chosen};
  for (std::optional<PlannedFit>* fit : {&plan.general, &plan.general_alike})
    if (*fit) fits.push_back(&**fit);
  progress.start("errors on the screen", static_cast<std::int64_t>(fits.size()));
  for (std::size_t i = 0; i < fits.size(); ++i) {
    PlannedFit& fit = *fits[i];
    // The general fit that is alike may be the general fit.
    if (i > 0 && fit.material == fits[i - 1]->material) {
      fit.on_screen = fits[i - 1]->on_screen;
    } else {
      OnScreen seen;
      render::Level level{fit.material.get(), {}};
      VENEER_ASSIGN(seen.centre, measure_on_screen(reference, scene, profile, level));
      level.drawing.average_texels = true;
      VENEER_ASSIGN(seen.averaged, measure_on_screen(reference, scene, profile, level));
      fit.on_screen = seen;
    }
    progress.advance();
  }
  progress.finish(fmt::format("{} pixels from {} places", reference.counts().compared, kPlanViews));
  return {};
}

}  // namespace veneer::quality
