// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/ring_directions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace veneer::simulation {
namespace {

constexpr double kTolerance = 1e-12;  // a few roundings of sine and cosine

TEST(RingDirections, AreAsManyAsAskedForUnitAndDistinctWithin75Degrees) {
  for (const int count : {1, 25, 49, 81, 151}) {
    const auto directions = ring_directions(count);
    ASSERT_TRUE(directions.has_value()) << directions.error().what;
    ASSERT_EQ(directions->size(), static_cast<std::size_t>(count));
    EXPECT_NEAR((directions->front() - btf::Direction::UnitZ()).norm(), 0.0, kTolerance);
    for (std::size_t i = 0; i < directions->size(); ++i) {
      EXPECT_NEAR((*directions)[i].norm(), 1.0, kTolerance) << count << ": " << i;
      EXPECT_GE((*directions)[i].z(), std::cos(75.0 * std::numbers::pi / 180.0) - kTolerance);
      for (std::size_t k = 0; k < i; ++k) {
        EXPECT_LT((*directions)[i].dot((*directions)[k]), std::cos(0.08))
            << count << ": " << i << " and " << k;
      }
    }
  }
}

TEST(RingDirections, RefuseOtherCountsAndNameThoseTheyHave) {
  for (const int count : {-1, 0, 2, 80, 1000}) {
    const auto directions = ring_directions(count);
    ASSERT_FALSE(directions.has_value()) << count;
    EXPECT_EQ(directions.error().code, Errc::kInvalidOption);
    EXPECT_THAT(directions.error().what, testing::HasSubstr("1, 25, 49, 81 and 151"));
  }
}

}  // namespace
}  // namespace veneer::simulation
