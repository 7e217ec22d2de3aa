// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "simulation/bench/rig.h"

namespace veneer::simulation {
namespace {

std::filesystem::path benches() { return VENEER_ETC "/benches"; }

std::unique_ptr<Bench> bench_named(const std::string& name) {
  auto bench = Bench::load(benches() / (name + ".toml"));
  if (!bench) ADD_FAILURE() << name << ": " << bench.error().what;
  VENEER_CHECK(bench.has_value());
  return std::move(*bench);
}

constexpr std::uint16_t kFull = 255;

Xyz above_black(const Bench& bench, const Rgb16& code, const Eigen::Vector2d& pixel) {
  return bench.board(code, pixel, 1, false) - bench.board({}, pixel, 1, false);
}

/// (R + G + B - W) / W of the luminances above black, in the middle of the raster.
double additivity_error(const Bench& bench) {
  const ProjectorTruth& p = bench.truth().projector;
  const auto luminance = [&](const Rgb16& code) {
    return above_black(bench, code, {0.5 * p.width, 0.5 * p.height}).y();
  };
  const double white = luminance({kFull, kFull, kFull});
  const double sum = luminance({kFull, 0, 0}) + luminance({0, kFull, 0}) + luminance({0, 0, kFull});
  return (sum - white) / white;
}

/// The part by which the colour of a channel's eighth of full light strays from that of its full
/// drive, in its own luminance.
double colour_drift(const Bench& bench, std::size_t channel) {
  const ProjectorTruth& p = bench.truth().projector;
  const Eigen::Vector2d middle(0.5 * p.width, 0.5 * p.height);
  Rgb16 code{};
  code[channel] = kFull;
  const Xyz full = above_black(bench, code, middle);
  do {
    --code[channel];
  } while (above_black(bench, code, middle).y() > full.y() / 8);
  const Xyz low = above_black(bench, code, middle);
  return (low / low.y() - full / full.y()).norm() / (full / full.y()).norm();
}

TEST(Benches, SevenAreThereAndEachCanBeCalibrated) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(benches())) {
    const std::string name = entry.path().stem().string();
    const auto bench = bench_named(name);
    ASSERT_TRUE(bench);
    const auto rig = VirtualRig::create(*bench);
    ASSERT_TRUE(rig) << name << ": " << rig.error().what;
    EXPECT_GE((*rig)->board_poses(), 8) << name;
    EXPECT_EQ(bench->truth().object.mesh, "sphere") << name << ": what etc/demo/scene.toml shows";
    ++count;
  }
  EXPECT_GE(count, 7);
}

TEST(Benches, ChannelsAddUpWhereTheFileSaysSo) {
  for (const char* name :
       {"plain-lcd", "chromaticity-drift", "strong-vignetting", "noisy-instrument"})
    EXPECT_NEAR(additivity_error(*bench_named(name)), 0, 1e-9) << name;
  EXPECT_LT(additivity_error(*bench_named("demo")), 0.01);
}

TEST(Benches, TheWhiteSegmentIsAQuarterOfWhite) {
  EXPECT_NEAR(additivity_error(*bench_named("white-segment")), -0.25, 1e-9);
}

TEST(Benches, CrosstalkIsFivePercentOfEachChannel) {
  EXPECT_NEAR(additivity_error(*bench_named("crosstalk")), 0.05 / 0.95, 1e-9);
}

TEST(Benches, OnlyOneDrifts) {
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_LT(colour_drift(*bench_named("plain-lcd"), c), 1e-9) << c;
    // Six percent times seven eighths of the distance between two chromaticities, which is about
    // as long as a chromaticity itself.
    EXPECT_GT(colour_drift(*bench_named("chromaticity-drift"), c), 0.02) << c;
  }
}

TEST(Benches, OneLampWarmsUp) {
  const auto bench = bench_named("plain-lcd");
  VirtualPatchDisplay display(*bench);
  ASSERT_TRUE(display.show({kFull, kFull, kFull}));
  EXPECT_DOUBLE_EQ(display.lamp(), 0.975);
  display.pass(200);
  EXPECT_NEAR(display.lamp(), 1 - 0.025 / std::exp(1), 1e-12);
}

TEST(Benches, StrongVignettingTakesMoreThanHalf) {
  const auto bench = bench_named("strong-vignetting");
  const VirtualProjector projector(bench->truth().projector);
  double least = 1;
  double most = 1;
  for (int y = 0; y <= 360; y += 10)
    for (int x = 0; x <= 480; x += 10) {
      least = std::min(least, projector.vignetting(Eigen::Vector2d(x, y)));
      most = std::max(most, projector.vignetting(Eigen::Vector2d(x, y)));
    }
  EXPECT_LT(least, 0.5 * most);
  EXPECT_GT(most, 1.001) << "the brightest place is not the middle";
}

TEST(Benches, ThePoorInstrumentIsOffByAboutAHundredthOfPureColours) {
  const auto bench = bench_named("noisy-instrument");
  const InstrumentTruth& instrument = bench->truth().instrument;
  EXPECT_EQ(instrument.relative_noise, 0.02);
  double worst = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    Rgb16 code{};
    code[c] = kFull;
    const Xyz light = above_black(*bench, code, {240, 180});
    worst = std::max(worst, (instrument.matrix_error * light).norm() / light.norm());
  }
  EXPECT_GT(worst, 0.005);
  EXPECT_LT(worst, 0.015);
}

}  // namespace
}  // namespace veneer::simulation
