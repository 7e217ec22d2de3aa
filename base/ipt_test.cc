// SPDX-License-Identifier: Apache-2.0
#include "base/ipt.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace veneer {
namespace {

using Eigen::Vector3d;

TEST(Ipt, PutsWhiteAndGreysOnTheAxisAndReturns) {
  const Vector3d d65(0.9505, 1.0, 1.0890);
  // The published matrices have four digits.
  constexpr double kPublishedDigits = 2e-3;
  EXPECT_LT((ipt_from_cones(cones_from_xyz() * d65) - Ipt(1, 0, 0)).norm(), kPublishedDigits);
  EXPECT_LT((ipt_from_cones(Vector3d::Constant(0.2)) - Ipt(std::pow(0.2, 0.43), 0, 0)).norm(),
            1e-12);
  Pcg32 random(7);
  for (int i = 0; i < 200; ++i) {
    const Vector3d cones =
        Vector3d(2 * random.uniform(), 2 * random.uniform(), 2 * random.uniform()) -
        Vector3d::Constant(0.5);
    EXPECT_LT((cones_from_ipt(ipt_from_cones(cones)) - cones).norm(), 1e-9) << cones.transpose();
  }
}

}  // namespace
}  // namespace veneer
