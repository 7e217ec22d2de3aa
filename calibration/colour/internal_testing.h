// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "base/random.h"
#include "calibration/colour/colour_patches.h"
#include "calibration/colour/ladder.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {

/// For tests: every patch that any family needs, read from an invented projector.
struct ExampleReadings {
  std::vector<PatchReading> patches;
  Xyz black = Xyz::Zero();
};

inline std::vector<Rgb16> example_patches() {
  const ColourPatchOptions options;
  std::vector<Rgb16> patches = ramp_patches(options);
  const std::vector<Rgb16> mixtures = interaction_patches(options);
  patches.insert(patches.end(), mixtures.begin(), mixtures.end());
  return patches;
}

inline ExampleReadings example_readings(const LadderDefects& defects,
                                        double noise = 0.0,
                                        std::uint64_t seed = 1) {
  ExampleReadings readings;
  readings.patches = LadderProjector(defects).read(example_patches(), 8, noise, seed);
  readings.black = mean_black(readings.patches);
  return readings;
}

inline constexpr LadderDefects kEveryDefect{0.06, 0.25, 0.05};

inline Eigen::Vector3d random_drive(Pcg32& random) {
  const double r = random.uniform();
  const double g = random.uniform();
  return {r, g, random.uniform()};
}

}  // namespace veneer::calibration
