// SPDX-License-Identifier: Apache-2.0
#include "simulation/recovery/layer_trial.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"
#include "simulation/materials/ring_directions.h"

namespace veneer::simulation {
namespace {

LayerTrialOptions quick_options() {
  LayerTrialOptions options;
  options.size = 24;
  options.directions = *ring_directions(25);
  options.samples = 8;
  return options;
}

TEST(LayerTrial, RefusesDirectionsOfWhichNoneIsGrazing) {
  const TemporaryFolder folder;
  SilentProgress silent;
  LayerTrialOptions options = quick_options();
  options.size = 4;
  options.directions = *ring_directions(1);
  const auto trial = try_layers(*find_body_material("bars"), options, folder.path(), silent);
  ASSERT_FALSE(trial.has_value());
  EXPECT_EQ(trial.error().code, Errc::kInvalidOption);
}

// What a fit gives back of geometry that no height field holds, and what it says of views that it
// has not seen. `veneer bench layers` does this at full size.
TEST(LayerTrial, FindsBarsAndLichenAgain) {
  const TemporaryFolder folder;
  SilentProgress silent;
  for (const BodyMaterial& material : body_materials()) {
    const auto trial = try_layers(material, quick_options(), folder.path(), silent);
    ASSERT_TRUE(trial) << trial.error().what;
    EXPECT_GE(trial->agreement.occupancy, 0.9) << material.name;
    EXPECT_GT(trial->agreement.occupancy, trial->agreement.occupancy_of_none) << material.name;
    EXPECT_LE(trial->agreement.normal_median_deg, 10.0) << material.name;
    EXPECT_LE(trial->layered.rmse, 2.0 * trial->noise + trial->clustered.rmse) << material.name;
    EXPECT_LT(trial->grazing.layered, trial->grazing.lpca) << material.name;
  }
}

}  // namespace
}  // namespace veneer::simulation
