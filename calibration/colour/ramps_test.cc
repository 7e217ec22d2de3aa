// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/ramps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

constexpr double kRounding = 1e-12;  // of readings of a few hundred cd/m^2, in parts

ExampleReadings clean() { return example_readings({}); }

void expect_refused(const ExampleReadings& readings, const std::string& why) {
  const auto ramps = read_ramps(readings.patches, readings.black);
  ASSERT_FALSE(ramps.has_value()) << why;
  EXPECT_EQ(ramps.error().code, Errc::kBadFormat);
  EXPECT_THAT(ramps.error().what, HasSubstr(why));
}

TEST(Ramps, AreWhatWasReadLessBlack) {
  const ExampleReadings readings = clean();
  const auto ramps = read_ramps(readings.patches, readings.black);
  ASSERT_TRUE(ramps.has_value()) << ramps.error().what;
  const LadderProjector projector({});
  for (Eigen::Index c = 0; c < 3; ++c) {
    const ChannelRamp& ramp = (*ramps)[static_cast<std::size_t>(c)];
    ASSERT_EQ(ramp.drives.size(), 17U);
    EXPECT_EQ(ramp.drives.front(), 0.0);
    EXPECT_EQ(ramp.drives.back(), 1.0);
    EXPECT_TRUE(std::ranges::is_sorted(ramp.drives));
    for (std::size_t i = 0; i < ramp.drives.size(); ++i) {
      const Xyz expected =
          projector.light(ramp.drives[i] * Eigen::Vector3d::Unit(c)) - projector.black();
      EXPECT_LT((ramp.light[i] - expected).norm(), kRounding * 1e3) << c << " " << i;
    }
  }
}

TEST(Ramps, DoNotMindDuplicatesNorOrder) {
  ExampleReadings readings = clean();
  const auto once = read_ramps(readings.patches, readings.black);
  const auto mixtures = read_mixtures(readings.patches, readings.black);
  std::vector<PatchReading> twice = readings.patches;
  twice.insert(twice.end(), readings.patches.rbegin(), readings.patches.rend());
  const auto again = read_ramps(twice, readings.black);
  ASSERT_TRUE(once.has_value() && again.has_value());
  for (std::size_t c = 0; c < 3; ++c) {
    ASSERT_EQ((*once)[c].drives, (*again)[c].drives);
    for (std::size_t i = 0; i < (*once)[c].light.size(); ++i)
      EXPECT_LT(((*once)[c].light[i] - (*again)[c].light[i]).norm(), kRounding * 1e3);
  }
  EXPECT_EQ(read_mixtures(twice, readings.black).size(), mixtures.size());
  EXPECT_EQ(count_drives(twice), count_drives(readings.patches));
}

TEST(Ramps, NeverFallWhateverTheNoise) {
  // Noise of a tenth of full drive's luminance in a thousandth: every dark level is under black.
  const LadderProjector projector({});
  Pcg32 random(5);
  for (int trial = 0; trial < 20; ++trial) {
    ExampleReadings readings = clean();
    for (PatchReading& reading : readings.patches)
      reading.xyz += 0.3 * Xyz(random.normal(), random.normal(), random.normal());
    const auto ramps = read_ramps(readings.patches, projector.black() + Xyz(0.5, 0.5, 0.5));
    ASSERT_TRUE(ramps.has_value()) << ramps.error().what;
    for (const ChannelRamp& ramp : *ramps) {
      for (std::size_t i = 1; i < ramp.light.size(); ++i)
        EXPECT_TRUE(((ramp.light[i] - ramp.light[i - 1]).array() >= 0.0).all()) << trial;
      EXPECT_TRUE(ramp.light.front().isZero(0.0));
    }
  }
}

TEST(Ramps, AreRefusedWhereTheyMakeNoModel) {
  {
    ExampleReadings readings = clean();
    readings.patches[20].xyz.y() = std::nan("");
    expect_refused(readings, "not finite");
  }
  {
    ExampleReadings readings = clean();
    readings.patches[20].drive.x() = 1.5;
    expect_refused(readings, "not in [0, 1]");
  }
  {
    ExampleReadings readings = clean();
    readings.black.x() = std::numeric_limits<double>::infinity();
    expect_refused(readings, "black is not finite");
  }
  {
    ExampleReadings readings = clean();
    std::erase_if(readings.patches,
                  [](const PatchReading& patch) { return patch.drive.y() == 1.0; });
    expect_refused(readings, "green ramp has 15 levels without full drive");
  }
  {
    ExampleReadings readings = clean();
    readings.patches.resize(5);
    expect_refused(readings, "3 or more");
  }
  expect_refused({}, "red ramp has 0 levels");
  {
    ExampleReadings readings = clean();
    for (PatchReading& patch : readings.patches) {
      if (patch.drive.z() > 0.0) patch.xyz = readings.black;
    }
    expect_refused(readings, "blue sends no light");
  }
  {
    ExampleReadings readings = clean();
    const LadderProjector projector({});
    for (PatchReading& patch : readings.patches) {
      if (patch.drive.x() > 0.0 && patch.drive.y() == 0.0 && patch.drive.z() == 0.0)
        patch.xyz = projector.light({0.0, patch.drive.x(), 0.0});
    }
    expect_refused(readings, "same colour");
  }
  {
    ExampleReadings readings = clean();
    for (PatchReading& patch : readings.patches) {
      if (patch.drive.x() > 0.5 && patch.drive.x() < 0.6) patch.xyz = 0.1 * patch.xyz;
    }
    expect_refused(readings, "red ramp falls");
  }
  {
    ExampleReadings readings = clean();
    readings.patches.push_back({Eigen::Vector3d::UnitX(), Xyz(1, 1, 1)});
    expect_refused(readings, "apart");
  }
}

TEST(Ramps, MayHaveNoBlackAtAll) {
  ExampleReadings readings = clean();
  for (PatchReading& patch : readings.patches) patch.xyz -= readings.black;
  readings.black = Xyz::Zero();
  EXPECT_TRUE(read_ramps(readings.patches, readings.black).has_value());
}

TEST(Mixtures, AreThePatchesOfSeveralChannels) {
  const ExampleReadings readings = clean();
  const auto mixtures = read_mixtures(readings.patches, readings.black);
  EXPECT_EQ(mixtures.size(), interaction_patches({}).size());
  for (const PatchReading& mixture : mixtures)
    EXPECT_GE((mixture.drive.array() > 0.0).count(), 2) << mixture.drive.transpose();
}

TEST(PerceptualWeight, FallsAndIsFiniteAtZero) {
  EXPECT_TRUE(std::isfinite(perceptual_weight(0.0)));
  double last = perceptual_weight(0.0);
  for (double light = 0.01; light <= 1.5; light += 0.01) {
    EXPECT_LT(perceptual_weight(light), last);
    last = perceptual_weight(light);
  }
}

}  // namespace
}  // namespace veneer::calibration
