// SPDX-License-Identifier: Apache-2.0
// Polarisers that do nothing and a device's clock that stands still, with invalid operations and
// divisions by zero trapped.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "base/testing/fp_trap.h"
#include "capture/polarisation/separation.h"
#include "tracking/device/clock_mapper.h"

namespace veneer {
namespace {

using Eigen::Array3d;

struct Rig {
  const char* name;
  double light;  ///< extinctions
  double analyser;
};
const Rig kUselessRigs[] = {
    {"LightUnpolarised", 1, 1e4},
    {"AnalyserMissing", 1e4, 1},
    {"BothMissing", 1, 1},
    {"BarelyPolarised", 1 + 1e-12, 1 + 1e-12},
};

class NoPolariser : public testing::TestWithParam<Rig> {
 protected:
  // Both pictures of a mirror and of a diffuser.
  static Array3d parallel(const capture::Contrasts& c) { return 0.5 * (1 + c.specular); }
  static Array3d cross(const capture::Contrasts& c) { return 0.5 * (1 - c.specular); }
};

TEST_P(NoPolariser, SeparatesNothingAndSaysSo) {
  const FpTrap trap;
  const auto contrasts = capture::Contrasts::of_rig(GetParam().light, GetParam().analyser, 0);
  EXPECT_LT(contrasts.of_polarisers().abs().maxCoeff(), capture::kLeastContrast);
  const Array3d light = Array3d::Constant(0.3);
  const Array3d variance = Array3d::Constant(1e-6);
  const capture::Parts parts = capture::separate(light, light, variance, variance, contrasts);
  for (int c = 0; c < 3; ++c) {
    // No number, and a weight of nothing: masked, not guessed.
    EXPECT_TRUE(std::isnan(parts.specular[c]) && std::isnan(parts.diffuse[c]));
    EXPECT_TRUE(std::isinf(parts.specular_variance[c]) && std::isinf(parts.diffuse_variance[c]));
  }
}

TEST_P(NoPolariser, IsRefusedWhereItIsMeasured) {
  const FpTrap trap;
  const auto contrasts = capture::Contrasts::of_rig(GetParam().light, GetParam().analyser, 0);
  const Array3d half = Array3d::Constant(0.5);
  const auto measured =
      capture::Contrasts::measure(parallel(contrasts), cross(contrasts), half, half);
  ASSERT_FALSE(measured);
  EXPECT_EQ(measured.error().code, Errc::kBadFormat);
  EXPECT_NE(measured.error().what.find("a polariser is missing"), std::string::npos)
      << measured.error().what;
}
INSTANTIATE_TEST_SUITE_P(All, NoPolariser, testing::ValuesIn(kUselessRigs), [](const auto& at) {
  return std::string(at.param.name);
});

struct StandingClock {
  const char* name;
  int bits;
  std::uint64_t ticks;  ///< where it stands
};
const StandingClock kStandingClocks[] = {
    {"AtZero", 32, 0},
    {"AtItsEnd", 32, 0xFFFFFFFFU},
    {"OfOneBit", 1, 1},
    {"OfAllBits", 64, ~std::uint64_t{0}},
};

// 10 s of samples, a millisecond apart, all with one time stamp.
class ClockThatStands : public testing::TestWithParam<StandingClock> {};
TEST_P(ClockThatStands, SaysThatAllWasMeasuredAtTheFirstArrival) {
  const FpTrap trap;
  tracking::ClockMapper mapper({{.bits = GetParam().bits}, 1e-3});
  const Time begin{std::chrono::seconds(100)};
  for (int i = 0; i < 10000; ++i) {
    const auto mapped = mapper.map(GetParam().ticks, begin + std::chrono::milliseconds(i));
    ASSERT_EQ(mapped.verdict, tracking::ClockMapper::Verdict::kMapped) << i;
    ASSERT_EQ(mapped.time, begin) << i;
    // What stands still is no clock to rely on.
    ASSERT_FALSE(mapped.locked) << i;
    ASSERT_EQ(mapper.skew(), 0) << i;
  }
}

TEST_P(ClockThatStands, IsFollowedAgainOnceItGoes) {
  const FpTrap trap;
  tracking::ClockMapper mapper({{.bits = GetParam().bits}, 1e-3});
  const Time begin{std::chrono::seconds(100)};
  for (int i = 0; i < 1000; ++i)
    (void)mapper.map(GetParam().ticks, begin + std::chrono::milliseconds(i));
  const Time again = begin + std::chrono::seconds(1);
  Time last{};
  for (int i = 1; i <= 6000; ++i) {
    const Time arrival = again + std::chrono::milliseconds(i);
    const auto mapped = mapper.map(GetParam().ticks + static_cast<std::uint64_t>(i), arrival);
    ASSERT_LE(mapped.time, arrival) << i;
    last = mapped.time;
  }
  if (GetParam().bits < 32) return;  // a counter of one bit tells no time
  // The window is 4 s: what it stood through is forgotten by then. Nothing is late here.
  EXPECT_LT(std::abs(to_seconds(again + std::chrono::milliseconds(6000) - last)), 1e-3);
}
INSTANTIATE_TEST_SUITE_P(All,
                         ClockThatStands,
                         testing::ValuesIn(kStandingClocks),
                         [](const auto& at) { return std::string(at.param.name); });

}  // namespace
}  // namespace veneer
