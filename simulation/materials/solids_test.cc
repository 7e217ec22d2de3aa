// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/solids.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"
#include "simulation/materials/body_materials.h"
#include "simulation/materials/internal_test_fields.h"

namespace veneer::simulation {
namespace {

constexpr int kCells = 16;
constexpr double kNear = 1e-3;  // cells: steps of the march and the lift are a tenth of it

BodyField field_of(std::vector<Body> bodies) {
  BodyField field;
  field.resolution = kCells;
  field.bodies = std::move(bodies);
  field.surface_at = [](const Eigen::Vector3d&, int body) {
    Surface surface = white_lambert();
    if (body != BodyField::kGround) surface.albedo = {0.5F, 0.25F, 0.125F};
    return surface;
  };
  return field;
}

// Spheres, a leaning capsule, a leaf and a bar; some across the tile's edges.
BodyField clutter() {
  return field_of({sphere({0.3, 0.4, 0.15}, 0.1),
                   sphere({0.98, 0.02, 0.2}, 0.12),
                   capsule({0.6, 0.9, 0.0}, {0.75, 1.1, 0.3}, 0.04),
                   disc({0.7, 0.3, 0.2}, {0.03, -0.05, 0.08}, 0.01),
                   endless_bar(true, 0.6, 0.3, 0.08, 0.03, 0.01)});
}

TEST(Body, DistancesAreThoseOfItsShape) {
  const Body ball = sphere({0.1, 0.2, 0.3}, 0.05);
  EXPECT_NEAR(ball.distance({0.1, 0.2, 0.5}), 0.15, 1e-12);
  EXPECT_NEAR(ball.distance({0.1, 0.2, 0.3}), -0.05, 1e-12);
  const Body rod = capsule({0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, 0.1);
  EXPECT_NEAR(rod.distance({0.5, 0.4, 0.3}), 0.4, 1e-12);
  EXPECT_NEAR(rod.distance({1.3, 0.4, 0.0}), 0.4, 1e-12);
  const Body leaf = disc({0.0, 0.0, 1.0}, {0.0, 0.0, 0.5}, 0.1);
  EXPECT_NEAR(leaf.distance({0.3, 0.2, 0.2}), 0.7, 1e-12);
  EXPECT_NEAR(leaf.distance({0.9, 0.0, 1.3}), 0.4, 1e-12);
  const Body bar = endless_bar(false, 0.5, 0.2, 0.1, 0.04, 0.01);
  for (const double y : {-3.0, 0.0, 0.7}) {
    EXPECT_NEAR(bar.distance({0.5, y, 0.3}), 0.06, 1e-12);
    EXPECT_NEAR(bar.distance({0.7, y, 0.2}), 0.1, 1e-12);
    EXPECT_NEAR(
        bar.distance({0.69 + 0.03, y, 0.23 + 0.04}), std::hypot(0.13, 0.04 + 0.0) - 0.01, 1e-12);
  }
}

TEST(Body, StaysWithinItsBounds) {
  for (const Body& body : clutter().bodies) {
    const auto [low, high] = body.bounds();
    Pcg32 random(2);
    Eigen::Vector3d least = Eigen::Vector3d::Constant(9.0);
    Eigen::Vector3d most = -least;
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3d away(random.normal(), random.normal(), random.normal());
      // A point of the surface, as seen from far away; of a bar's axis any place will do.
      Eigen::Vector3d far = 50.0 * away;
      for (int axis = 0; axis < 3; ++axis)
        if (std::isfinite(low[axis])) far[axis] += 0.5 * (low[axis] + high[axis]);
      const Eigen::Vector3d near = body.nearest(far);
      const Eigen::Vector3d point = near + body.radius * (far - near).normalized();
      least = least.cwiseMin(point);
      most = most.cwiseMax(point);
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (std::isinf(low[axis])) continue;
      EXPECT_GE(least[axis], low[axis] - 1e-9);
      EXPECT_LE(most[axis], high[axis] + 1e-9);
      // Tight: within what random points leave.
      EXPECT_NEAR(least[axis], low[axis], 0.01);
      EXPECT_NEAR(most[axis], high[axis], 0.01);
    }
  }
}

// One sphere against the quadratic formula, from all sides.
TEST(Solids, ASphereIsHitWhereTheFormulaSays) {
  const Eigen::Vector3d middle(0.5, 0.5, 0.3);
  constexpr double kRadius = 0.12;
  const Solids solids(field_of({sphere(middle, kRadius)}));
  Pcg32 random(3);
  int hits = 0;
  for (int i = 0; i < 8000; ++i) {
    const Eigen::Vector3d from(random.uniform(), random.uniform(), 0.6 * random.uniform());
    const Eigen::Vector3d away = from - middle;
    if (away.norm() < 1.001 * kRadius) continue;
    const Eigen::Vector3d along =
        Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    // Rays that leave the tile may meet the sphere's next image: only what is in the tile counts.
    const double b = away.dot(along);
    const double square = b * b - away.squaredNorm() + kRadius * kRadius;
    if (b >= 0.0 || square < 1e-4) continue;
    const double t = -b - std::sqrt(square);
    const Eigen::Vector3d expected = from + t * along;
    if ((from.array() < 0.0).any() || expected.z() < 0.0) continue;
    const auto hit = solids.first_hit(from * kCells, along);
    ASSERT_TRUE(hit.has_value());
    EXPECT_NEAR((solids.position(*hit) - expected * kCells).norm(), 0.0, kNear) << i;
    EXPECT_NEAR((solids.normal(*hit) - (expected - middle) / kRadius).norm(), 0.0, kNear) << i;
    EXPECT_FLOAT_EQ(solids.surface(*hit).albedo[1], 0.25F);
    ++hits;
  }
  EXPECT_GT(hits, 100);
}

TEST(Solids, AreHitWhereSmallStepsMeetThem) {
  constexpr double kStep = 1e-3;  // cells; a body may be grazed by less
  const BodyField field = clutter();
  const Solids solids(field);
  // Sees the bodies of the tiles around, whatever the columns hold.
  const auto distance = [&](const Eigen::Vector3d& cells) {
    const Eigen::Vector3d at = cells / kCells;
    const Eigen::Vector3d home(at.x() - std::floor(at.x()), at.y() - std::floor(at.y()), at.z());
    double least = at.z();
    for (const Body& body : field.bodies)
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
          least = std::min(least, body.distance(home + Eigen::Vector3d(x, y, 0.0)));
    return least;
  };
  Pcg32 random(11);
  int misses = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d from(
        60.0 * random.uniform() - 30.0, 60.0 * random.uniform() - 30.0, solids.top() + 0.5);
    const Eigen::Vector3d along =
        Eigen::Vector3d(random.normal(), random.normal(), -0.3 - random.uniform()).normalized();
    const auto hit = solids.first_hit(from, along);
    ASSERT_TRUE(hit.has_value()) << from.transpose() << " along " << along.transpose();
    Eigen::Vector3d stepped = from;
    while (distance(stepped) > 0.0)
      stepped += std::max(kStep, 0.5 * kCells * distance(stepped)) * along;
    EXPECT_NEAR(distance(solids.position(*hit)), 0.0, 1e-5);
    if (std::abs(stepped.z() - hit->z) > 3.0 * kStep) ++misses;
  }
  EXPECT_LE(misses, 6);  // grazes
}

TEST(Solids, RepeatWithTheTile) {
  const Solids solids(clutter());
  Pcg32 random(5);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d from(
        kCells * random.uniform(), kCells * random.uniform(), kCells * random.uniform());
    const Eigen::Vector3d along =
        Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    const auto here = solids.first_hit(from, along);
    const auto there =
        solids.first_hit(from + Eigen::Vector3d(-3.0 * kCells, 2.0 * kCells, 0.0), along);
    ASSERT_EQ(here.has_value(), there.has_value()) << i;
    if (!here) continue;
    // Across the tile's edge a place may be told from either side.
    const Eigen::Vector3d apart = solids.position(*here) - solids.position(*there);
    EXPECT_NEAR(std::remainder(apart.x(), kCells), 0.0, kNear) << i;
    EXPECT_NEAR(std::remainder(apart.y(), kCells), 0.0, kNear) << i;
    EXPECT_NEAR(apart.z(), 0.0, kNear) << i;
  }
}

TEST(Solids, HaveAnUndersideThatFacesTheGround) {
  const Solids solids(field_of({endless_bar(true, 0.5, 0.3, 0.2, 0.05, 0.01)}));
  const Eigen::Vector3d below(3.3, 0.5 * kCells, 1.0);
  const auto hit = solids.first_hit(below, Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->z, 0.25 * kCells, kNear);
  EXPECT_NEAR(solids.normal(*hit).z(), -1.0, 1e-6);
  // Away from it again: down to the ground, which the bar does not hide.
  const auto ground =
      solids.first_hit(solids.lifted(*hit, solids.normal(*hit)), -Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(ground.has_value());
  EXPECT_NEAR(ground->z, 0.0, 1e-9);
  EXPECT_EQ(solids.surface(*ground).albedo[1], 1.0F);
}

TEST(Solids, LiftedRaysLeaveConvexBodies) {
  const Solids solids(field_of({sphere({0.5, 0.5, 0.4}, 0.15)}));
  Pcg32 random(8);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d from(kCells * random.uniform(), kCells * random.uniform(), solids.top());
    const auto hit = solids.first_hit(from, -Eigen::Vector3d::UnitZ());
    ASSERT_TRUE(hit.has_value());
    const Eigen::Vector3d normal = solids.normal(*hit);
    Eigen::Vector3d along(random.normal(), random.normal(), random.normal());
    along.normalize();
    if (normal.dot(along) < 0.02) continue;
    // One that goes down would meet the ground, with reason.
    if (along.z() < 0.1) continue;
    const auto again = solids.first_hit(solids.lifted(*hit, normal), along);
    // From the ground a sphere may be in the way; never the point itself.
    EXPECT_TRUE(!again || (solids.position(*again) - solids.position(*hit)).norm() > 0.5) << i;
  }
}

TEST(Solids, LetRaysLeaveUpwardsAndStopThoseFromBelow) {
  const Solids solids(clutter());
  EXPECT_FALSE(solids.first_hit({1.5, 1.5, solids.top() + 0.1}, Eigen::Vector3d::UnitZ()));
  EXPECT_FALSE(solids.first_hit({1.5, 1.5, solids.top() + 0.1}, Eigen::Vector3d::UnitX()));
  // Level, between the ground and what hovers.
  const Solids bar(field_of({endless_bar(true, 0.5, 0.3, 0.2, 0.05, 0.01)}));
  EXPECT_FALSE(bar.first_hit({1.5, 1.5, 1.0}, Eigen::Vector3d(0.6, 0.8, 0.0)));
  const auto below = solids.first_hit({1.5, 1.5, -5.0}, Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(below.has_value());
  EXPECT_DOUBLE_EQ(below->z, -5.0);
}

TEST(Solids, TellTheSurfaceAboveAPlaceInside) {
  const Eigen::Vector3d middle(0.5, 0.5, 0.3);
  const Solids solids(field_of({sphere(middle, 0.2)}));
  const Eigen::Vector3d inside(0.6, 0.45, 0.3);
  const Eigen::Vector3d off(0.1, -0.05, std::sqrt(0.04 - 0.01 - 0.0025));
  EXPECT_NEAR((solids.normal_above(inside) - off / 0.2).norm(), 0.0, 1e-3);
  EXPECT_NEAR(solids.normal_above({0.1, 0.1, -0.2}).z(), 1.0, 1e-9);
}

TEST(BodyField, RefusesWhatIsNone) {
  ASSERT_TRUE(clutter().check().has_value());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const auto& spoil) {
    BodyField field = clutter();
    spoil(field);
    const Status status = field.check();
    return !status && status.error().code == Errc::kInvalidOption;
  };
  EXPECT_TRUE(refused([](BodyField& f) { f.resolution = 0; }));
  EXPECT_TRUE(refused([](BodyField& f) { f.tile_width_mm = 0.0; }));
  EXPECT_TRUE(refused([](BodyField& f) { f.surface_at = nullptr; }));
  EXPECT_TRUE(refused([](BodyField& f) { f.bodies[0].radius = 0.0; }));
  EXPECT_TRUE(refused([&](BodyField& f) { f.bodies[0].radius = kNan; }));
  EXPECT_TRUE(refused([&](BodyField& f) { f.bodies[1].first.y() = kNan; }));
  EXPECT_TRUE(refused([](BodyField& f) { f.bodies[2].second.x() = 40.0; }));
  EXPECT_TRUE(refused([](BodyField& f) { std::swap(f.bodies[4].first, f.bodies[4].second); }));
  EXPECT_TRUE(refused(
      [](BodyField& f) { f.bodies[0].first.x() = -std::numeric_limits<double>::infinity(); }));
}

}  // namespace
}  // namespace veneer::simulation
