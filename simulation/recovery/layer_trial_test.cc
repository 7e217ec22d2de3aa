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

}  // namespace
}  // namespace veneer::simulation
