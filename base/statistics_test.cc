// SPDX-License-Identifier: Apache-2.0
#include "base/statistics.h"

#include <gtest/gtest.h>

namespace veneer {
namespace {

TEST(Quantile, IsLinearBetweenSortedValues) {
  const std::vector<double> values{40, 10, 30, 20, 0};
  EXPECT_EQ(quantile(values, 0), 0);
  EXPECT_EQ(quantile(values, 0.5), 20);
  EXPECT_EQ(quantile(values, 1), 40);
  EXPECT_DOUBLE_EQ(quantile(values, 0.95), 38);
}

TEST(Quantile, IsDefinedForFewValuesAndRanksOutOfRange) {
  EXPECT_EQ(quantile({}, 0.5), 0);
  EXPECT_EQ(quantile({7}, 0.99), 7);
  EXPECT_EQ(quantile({1, 2}, 5), 2);
  EXPECT_EQ(quantile({1, 2}, -5), 1);
}

TEST(Mean, OfNothingIsZero) {
  EXPECT_EQ(mean({}), 0);
  EXPECT_EQ(mean({1, 2, 6}), 3);
}

}  // namespace
}  // namespace veneer
