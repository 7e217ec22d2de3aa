// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/registration.h"

#include <vector>

#include "base/statistics.h"
#include "simulation/bench/projector.h"

namespace veneer::simulation {

Result<RegistrationError> registration_error(const Bench& bench,
                                             const calibration::ProjectorGeometry& geometry,
                                             const RigidTransform& world_from_object,
                                             int step) {
  if (step < 1)
    return fail(Errc::kInvalidOption,
                "comparing where the picture lands: every {}-th pixel makes no sense",
                step);
  const ProjectorTruth& truth = bench.truth().projector;
  const VirtualProjector projector(truth);
  const RigidTransform projector_from_world = geometry.world_from_projector.inverse();
  std::vector<double> errors_px;
  for (int y = step / 2; y < truth.height; y += step)
    for (int x = step / 2; x < truth.width; x += step) {
      const auto x_in_world = bench.lit_point(world_from_object, {x + 0.5, y + 0.5});
      if (!x_in_world) continue;
      // The ray was traced in floats: where it ended is projected back.
      const auto true_pixel = projector.pixel_of(*x_in_world);
      if (!true_pixel) continue;
      const Eigen::Vector3d x_in_projector = projector_from_world * *x_in_world;
      if (!(x_in_projector.z() > 0))
        return fail(Errc::kInvalidOption,
                    "comparing where the picture lands: for the profile's pose the object lies "
                    "behind the lens; its geometry is wrong");
      const Eigen::Vector2d pixel(
          geometry.fx * x_in_projector.x() / x_in_projector.z() + geometry.cx,
          geometry.fy * x_in_projector.y() / x_in_projector.z() + geometry.cy);
      errors_px.push_back((pixel - *true_pixel).norm());
    }
  if (errors_px.empty())
    return fail(Errc::kInvalidOption,
                "comparing where the picture lands: the projector lights nothing of the object");
  return RegistrationError{static_cast<std::int64_t>(errors_px.size()),
                           quantile(errors_px, 0.5),
                           quantile(errors_px, 0.95),
                           quantile(errors_px, 1)};
}

}  // namespace veneer::simulation
