// SPDX-License-Identifier: Apache-2.0
#include "base/rigid_transform.h"

#include <gtest/gtest.h>

#include <numbers>

namespace veneer {
namespace {

using Eigen::Vector3d;
constexpr double kRounding = 1e-14;

const RigidTransform kPose{
    Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized())), {4, 5, 6}};

TEST(RigidTransform, InverseUndoesIt) {
  const Vector3d point(0.3, -2, 9);
  EXPECT_LT((kPose.inverse() * (kPose * point) - point).norm(), 10 * kRounding);
}

TEST(RigidTransform, ComposesAsItsMatricesDo) {
  const RigidTransform other{Eigen::Quaterniond(Eigen::AngleAxisd(-2, Vector3d::UnitY())),
                             {-1, 0, 2}};
  EXPECT_LT(((kPose * other).matrix() - kPose.matrix() * other.matrix()).norm(), 10 * kRounding);
}

TEST(LookAt, PutsTheTargetAheadAndUpAbove) {
  const Vector3d eye(1, 2, 3);
  const Vector3d target(0, 0.5, -1);
  const RigidTransform device_from_world = look_at(eye, target, Vector3d::UnitY()).inverse();
  const Vector3d ahead = device_from_world * target;
  EXPECT_NEAR(ahead.x(), 0, kRounding * 10);
  EXPECT_NEAR(ahead.y(), 0, kRounding * 10);
  EXPECT_NEAR(ahead.z(), (target - eye).norm(), kRounding * 10);
  EXPECT_LT((device_from_world * (target + 0.1 * Vector3d::UnitY())).y(), 0) << "y points down";
  // Seen from +z, +x lies to the right.
  EXPECT_GT((look_at({0, 0, 5}, {0, 0, 0}, Vector3d::UnitY()).inverse() * Vector3d(1, 0, 0)).x(),
            0);
}

TEST(LookAt, IsDefinedWhereTheDirectionIsUp) {
  for (const Vector3d& up : {Vector3d(0, 1, 0), Vector3d(0, 0, 0), Vector3d(0, -3, 0)}) {
    const RigidTransform pose = look_at({0, 0, 0}, {0, 2, 0}, up);
    EXPECT_NEAR(pose.rotation.norm(), 1, kRounding);
    EXPECT_LT((pose * Vector3d::UnitZ() - Vector3d::UnitY()).norm(), 10 * kRounding);
  }
  EXPECT_TRUE(look_at({1, 1, 1}, {1, 1, 1}, Vector3d::UnitY()).rotation.coeffs().allFinite());
}

}  // namespace
}  // namespace veneer
