// SPDX-License-Identifier: Apache-2.0
#include "capture/development/response.h"

#include <gtest/gtest.h>

#include <cmath>

namespace veneer::capture {
namespace {

TEST(ResponseCurve, LightAndCountsAreInverse) {
  for (const double gamma : {0.5, 1.0, 2.2}) {
    const ResponseCurve curve = ResponseCurve::gamma(gamma).value();
    for (double counts = 0; counts <= 1; counts += 0.01) {
      EXPECT_NEAR(curve.light(1, counts), std::pow(counts, gamma), gamma < 1 ? 0.02 : 1e-6);
      EXPECT_NEAR(curve.counts_fraction(1, curve.light(1, counts)), counts, 1e-9);
    }
    EXPECT_EQ(curve.linear(), gamma == 1);
  }
}

}  // namespace
}  // namespace veneer::capture
