// SPDX-License-Identifier: Apache-2.0
#include "cli/bench_profile.h"

namespace veneer::cli {

Result<calibration::MeasuredProfile> measure_profile_on_bench(
    const simulation::Bench& bench,
    simulation::VirtualPatchDisplay& display,
    simulation::VirtualColorimeter& colorimeter,
    Progress& progress) {
  calibration::RadiometryOptions options;
  options.bits = bench.truth().projector.bits;
  options.reference_distance_m = bench.truth().projector.reference_distance_m;
  return calibration::measure_profile(
      colorimeter, display, simulation::true_geometry(bench), options, progress);
}

}  // namespace veneer::cli
