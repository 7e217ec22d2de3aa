// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/colour_patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace veneer::calibration {
namespace {

int driven(const Rgb16& code) {
  return static_cast<int>(std::ranges::count_if(code, [](auto value) { return value > 0; }));
}

TEST(RampPatches, AreThreeRampsAndBlackAndFewEnough) {
  for (const int bits : {4, 8, 10, 16}) {
    ColourPatchOptions options;
    options.bits = bits;
    options.ramp_levels = std::min(16, (1 << bits) - 1);
    options.grey_levels = 4;
    ASSERT_TRUE(options.check().has_value());
    const std::vector<Rgb16> patches = ramp_patches(options);
    EXPECT_EQ(patches.size(), static_cast<std::size_t>(3 * options.ramp_levels + 4));
    EXPECT_LE(patches.size(), 64U);
    EXPECT_EQ(std::ranges::count(patches, Rgb16{}), 4);
    const std::set<Rgb16> different(patches.begin(), patches.end());
    EXPECT_EQ(different.size(), patches.size() - 3);
    EXPECT_TRUE(std::ranges::all_of(patches, [](const Rgb16& code) { return driven(code) <= 1; }));
    const auto full = static_cast<std::uint16_t>((1 << bits) - 1);
    for (std::size_t c = 0; c < 3; ++c) {
      Rgb16 primary{};
      primary[c] = full;
      EXPECT_EQ(std::ranges::count(patches, primary), 1) << bits << " " << c;
    }
  }
}

TEST(RampPatches, AreEquallySpacedInLightness) {
  ColourPatchOptions options;
  options.bits = 12;
  std::vector<double> lightness{0.0};
  for (const Rgb16& code : ramp_patches(options)) {
    if (code[0] > 0) lightness.push_back(std::cbrt(std::pow(code[0] / 4095.0, 2.2)));
  }
  for (std::size_t i = 1; i < lightness.size(); ++i)
    EXPECT_NEAR(lightness[i] - lightness[i - 1], 1.0 / 16, 0.002) << i;  // rounding to codes
}

TEST(InteractionPatches, AreMixturesOfLevelsThatTheRampsHave) {
  ColourPatchOptions options;
  const std::vector<Rgb16> ramps = ramp_patches(options);
  std::array<std::set<std::uint16_t>, 3> levels;
  for (const Rgb16& code : ramps) {
    for (std::size_t c = 0; c < 3; ++c) levels[c].insert(code[c]);
  }
  const std::vector<Rgb16> mixtures = interaction_patches(options);
  // 4^3 less black and 9 single levels, and the 13 greys that are not in the cube.
  EXPECT_EQ(mixtures.size(), 64U - 1 - 9 + 13);
  for (const Rgb16& code : mixtures) {
    EXPECT_GE(driven(code), 2);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_TRUE(levels[c].contains(code[c])) << code[c];
  }
  EXPECT_EQ(std::ranges::count(mixtures, Rgb16{255, 255, 255}), 1);
  options.cube = 0;
  options.grey_levels = 0;
  EXPECT_TRUE(interaction_patches(options).empty());
}

TEST(AdditivityPatches, HaveEveryMixtureWithItsChannels) {
  const std::vector<Rgb16> patches = additivity_patches({});
  EXPECT_EQ(patches.size(), 4U * 14U);
  for (const Rgb16& code : patches) {
    EXPECT_EQ(std::ranges::count(patches, code), 4);
    for (std::size_t c = 0; c < 3; ++c) {
      if (code[c] == 0) continue;
      Rgb16 single{};
      single[c] = code[c];
      EXPECT_EQ(std::ranges::count(patches, single), 4);
    }
  }
}

TEST(VerificationPatches, ShareNothingWithTheFitAndFillTheCube) {
  for (const int bits : {8, 10}) {
    ColourPatchOptions options;
    options.bits = bits;
    std::vector<Rgb16> fitted = ramp_patches(options);
    const std::vector<Rgb16> mixtures = interaction_patches(options);
    fitted.insert(fitted.end(), mixtures.begin(), mixtures.end());
    const std::vector<Rgb16> patches = verification_patches(bits, kVerificationPatches, fitted);
    ASSERT_EQ(patches.size(), 43U);
    EXPECT_EQ(std::set<Rgb16>(patches.begin(), patches.end()).size(), patches.size());
    std::set<int> octants;
    for (const Rgb16& code : patches) {
      EXPECT_EQ(std::ranges::count(fitted, code), 0);
      // Half of the lightness, as the patches are spaced.
      const double middle = ((1 << bits) - 1) * std::pow(0.5, 3.0 / 2.2);
      octants.insert((code[0] > middle) + 2 * (code[1] > middle) + 4 * (code[2] > middle));
    }
    EXPECT_EQ(octants.size(), 8U);
    // The same again; and without the fit's, even where those were the list itself.
    EXPECT_EQ(verification_patches(bits, kVerificationPatches, fitted), patches);
    for (const Rgb16& code : verification_patches(bits, kVerificationPatches, patches))
      EXPECT_EQ(std::ranges::count(patches, code), 0);
  }
}

TEST(ColourPatchOptions, RefusesWhatCannotBeShown) {
  const auto refused = [](auto change) {
    ColourPatchOptions options;
    change(options);
    const Status status = options.check();
    return !status.has_value() && status.error().code == Errc::kInvalidOption;
  };
  EXPECT_TRUE(ColourPatchOptions{}.check().has_value());
  EXPECT_TRUE(refused([](auto& o) { o.bits = 3; }));
  EXPECT_TRUE(refused([](auto& o) { o.bits = 17; }));
  EXPECT_TRUE(refused([](auto& o) { o.ramp_levels = 3; }));
  EXPECT_TRUE(refused([](auto& o) { o.bits = 4; }));  // 16 levels of 15
  EXPECT_TRUE(refused([](auto& o) { o.grey_levels = 17; }));
  EXPECT_TRUE(refused([](auto& o) { o.cube = 1; }));
  EXPECT_TRUE(refused([](auto& o) { o.cube = 10; }));
  EXPECT_TRUE(refused([](auto& o) { o.black_repeats = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.additivity_repeats = 0; }));
}

TEST(DriveOfCode, RunsFromZeroToOne) {
  EXPECT_EQ(drive_of_code({0, 255, 51}, 8), Eigen::Vector3d(0, 1, 0.2));
  EXPECT_EQ(drive_of_code({65535, 0, 0}, 16), Eigen::Vector3d(1, 0, 0));
}

}  // namespace
}  // namespace veneer::calibration
