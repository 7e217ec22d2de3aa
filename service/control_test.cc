// SPDX-License-Identifier: Apache-2.0
#include "service/control.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace veneer::service {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_refused(const LightSetting& light) {
  const Status status = light.check();
  return !status && status.error().code == Errc::kInvalidOption && !status.error().what.empty();
}

TEST(LightSetting, IsTakenFromDarknessToTenSuns) {
  LightSetting light;
  for (const double lux : {0.0, 1e-3, 500.0, 1e6}) {
    light.illuminance_lux = lux;
    EXPECT_TRUE(light.check()) << lux;
  }
  for (const double lux : {-1e-9, std::nextafter(1e6, 2e6), kInfinity, -kInfinity, kNan}) {
    light.illuminance_lux = lux;
    EXPECT_TRUE(is_refused(light)) << lux;
  }
}

TEST(LightSetting, NeedsADirectionOfAnyLengthButZero) {
  for (const double length : {1e-6, 1.0, 1e8}) {
    LightSetting light;
    light.direction_to_light = {0, -length, 0};
    EXPECT_TRUE(light.check()) << length;
  }
  for (const double x : {0.0, 1e-300, 1e9, 1e300, kInfinity, kNan}) {
    LightSetting light;
    light.direction_to_light = {x, 0, 0};
    EXPECT_TRUE(is_refused(light)) << x;
  }
}

TEST(LightSetting, NeedsAColourThatIsNotNegative) {
  for (int channel = 0; channel < 3; ++channel) {
    LightSetting light;
    light.colour[channel] = 0;
    EXPECT_TRUE(light.check()) << channel;
    for (const double value : {-1e-12, 2e6, kInfinity, kNan}) {
      light.colour[channel] = value;
      EXPECT_TRUE(is_refused(light)) << channel << ": " << value;
    }
  }
}

}  // namespace
}  // namespace veneer::service
