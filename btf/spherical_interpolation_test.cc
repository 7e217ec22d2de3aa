// SPDX-License-Identifier: Apache-2.0
#include "btf/spherical_interpolation.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "btf/internal_test_sets.h"
#include "btf/spherical_delaunay.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180.0;
// Weights are solutions of 3 x 3 systems whose condition stays below a few hundred for these sets.
constexpr double kRounding = 1e-11;

// Rings of equal theta like Bonn's; every `horizon` set ends at theta 90.
DirectionSet rings(const std::vector<std::pair<double, int>>& theta_and_count) {
  DirectionSet set;
  for (const auto& [theta, count] : theta_and_count)
    for (int i = 0; i < count; ++i)
      set.push_back(direction_from_angles({theta * kDegree, 2.0 * kPi * i / count}));
  return set;
}

DirectionSet scattered(int count, std::uint64_t seed, double lowest_z) {
  Pcg32 random(seed);
  DirectionSet set;
  for (int i = 0; i < count; ++i) set.push_back(testing::random_direction(random, lowest_z));
  return set;
}

struct NamedSet {
  const char* name;
  DirectionSet directions;
};

void PrintTo(const NamedSet& set, std::ostream* out) { *out << set.name; }

std::vector<NamedSet> surface_sets() {
  DirectionSet one_sided;
  for (const Direction& d : bonn_directions()) {
    if (d.x() > 0.3) one_sided.push_back(d);
  }
  return {{"bonn", bonn_directions()},
          {"to_the_horizon", rings({{0, 1}, {30, 8}, {60, 16}, {90, 24}})},
          {"horizon_of_four", rings({{45, 3}, {90, 4}})},
          {"no_normal", rings({{20, 5}, {60, 11}})},
          {"cap", rings({{10, 4}, {20, 5}})},
          {"one_sided", one_sided},
          {"scattered", scattered(200, 3, 0.05)},
          {"few", scattered(5, 4, 0.2)},
          {"three", rings({{40, 3}})},
          {"dense", scattered(1000, 5, 0.0)}};
}

class Triangulation : public ::testing::TestWithParam<NamedSet> {};

TEST_P(Triangulation, CircumcirclesAreEmpty) {
  const DirectionSet& set = GetParam().directions;
  for (const auto& [a, b, c] : triangulate_directions(set)) {
    const auto at = [&set](int i) { return set[static_cast<std::size_t>(i)]; };
    const Direction normal = (at(b) - at(a)).cross(at(c) - at(a)).normalized();
    ASSERT_GT(normal.dot(at(a)), 0.0) << "a triangle that faces inwards";
    for (const Direction& d : set) ASSERT_LT(normal.dot(d - at(a)), 1e-9);
  }
}

// A disc: each edge has one triangle on either side or lies on the border; vertices - edges + faces
// = 1; the border is one convex loop; every direction is used.
TEST_P(Triangulation, IsADiscWithAConvexBorder) {
  const DirectionSet& set = GetParam().directions;
  const auto triangles = triangulate_directions(set);
  std::map<std::pair<int, int>, int> left_of;
  std::set<int> used;
  for (const auto& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      used.insert(t[i]);
      EXPECT_EQ((++left_of[{t[i], t[(i + 1) % 3]}]), 1) << "two triangles left of one edge";
    }
  }
  EXPECT_EQ(used.size(), set.size());
  std::map<int, int> next_on_border;
  std::size_t edges = 0;
  for (const auto& [edge, count] : left_of) {
    const bool border = left_of.count({edge.second, edge.first}) == 0;
    if (border) {
      EXPECT_TRUE(next_on_border.emplace(edge.first, edge.second).second);
    }
    edges += border || edge.first < edge.second ? 1 : 0;
  }
  EXPECT_EQ(set.size() + triangles.size(), edges + 1);
  std::size_t length = 0;
  int vertex = next_on_border.begin()->first;
  do {
    const int next = next_on_border.at(vertex);
    for (const Direction& d : set)
      EXPECT_GE(side_of_arc(
                    set[static_cast<std::size_t>(vertex)], set[static_cast<std::size_t>(next)], d),
                0.0);
    vertex = next;
    ++length;
  } while (vertex != next_on_border.begin()->first && length <= next_on_border.size());
  EXPECT_EQ(length, next_on_border.size()) << "the border is no single loop";
}

TEST_P(Triangulation, WeightsSumToOneAndPointAlongTheDirection) {
  const DirectionSet& set = GetParam().directions;
  const SphericalInterpolator interpolator(set, DirectionRole::kLight);
  const double condition = set.size() > 500 ? 1e3 : 1.0;  // scattered sets have slivers
  Pcg32 random(7);
  int inside = 0;
  for (int i = 0; i < 5000; ++i) {
    const Direction d = testing::random_direction(random, -0.2);
    const DirectionWeights w = interpolator.weights(d);
    Direction mean = Direction::Zero();
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      ASSERT_GE(w.index[k], 0);
      ASSERT_LT(static_cast<std::size_t>(w.index[k]), set.size());
      ASSERT_GE(w.weight[k], 0.0);
      sum += w.weight[k];
      mean += w.weight[k] * set[static_cast<std::size_t>(w.index[k])];
    }
    ASSERT_NEAR(sum, 1.0, kRounding);
    ASSERT_GE(w.scale, 0.0);
    ASSERT_LE(w.scale, 1.0);
    if (d.z() < 0.0) {
      ASSERT_EQ(w.scale, 0.0);
    }
    if (w.weight[2] == 0.0 && mean.normalized().dot(d) < 1.0 - 1e-12)
      continue;  // taken to the border
    ++inside;
    // So quotients of linear functions, such as x / z, are reproduced exactly.
    EXPECT_LT(mean.normalized().cross(d).norm(), kRounding * condition) << d.transpose();
    EXPECT_EQ(w.scale, 1.0);
  }
  EXPECT_GT(inside, 100) << "the test saw hardly any direction inside";
}

TEST_P(Triangulation, IsExactAtItsDirections) {
  const DirectionSet& set = GetParam().directions;
  const SphericalInterpolator interpolator(set, DirectionRole::kLight);
  for (std::size_t i = 0; i < set.size(); ++i) {
    const DirectionWeights w = interpolator.weights(set[i]);
    double own = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      own += w.index[k] == static_cast<int>(i) ? w.weight[k] : 0.0;
    EXPECT_NEAR(own * w.scale, 1.0, 1e-9) << i;
  }
}

// A walk along random great circles must not jump anywhere, the border included. The value of a
// smooth function is used, since weights themselves may turn quickly in thin triangles.
TEST_P(Triangulation, IsContinuousAlongGreatCircles) {
  const DirectionSet& set = GetParam().directions;
  constexpr double kStep = 1e-5;
  for (const DirectionRole role : {DirectionRole::kView, DirectionRole::kLight}) {
    const SphericalInterpolator interpolator(set, role);
    const auto value = [&](const Direction& d) {
      const DirectionWeights w = interpolator.weights(d);
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Direction& p = set[static_cast<std::size_t>(w.index[k])];
        // A light's samples hold its cosine, so at the horizon they vanish.
        sum += w.weight[k] * (1.0 + 0.5 * p.x() - 0.3 * p.y()) *
               (role == DirectionRole::kLight ? p.z() : 1.0);
      }
      return w.scale * sum;
    };
    Pcg32 random(11);
    double steepest = 0.0;
    for (int circle = 0; circle < 200; ++circle) {
      const Direction start = testing::random_direction(random, 0.02);
      const Direction along = start.unitOrthogonal();
      double before = value(start);
      for (int i = 1; i <= 40; ++i) {
        // Short hops of kStep at strides over a quarter circle, upper hemisphere only: at the nadir
        // every azimuth meets.
        const double angle = i * 0.04;
        const Direction from = std::cos(angle) * start + std::sin(angle) * along;
        const Direction to = std::cos(angle + kStep) * start + std::sin(angle + kStep) * along;
        if (from.z() < 0.02 || to.z() < 0.02) continue;
        before = value(from);
        steepest = std::max(steepest, std::abs(value(to) - before) / kStep);
      }
    }
    // A jump would be about 1 / kStep = 1e5; slopes of these functions between neighbours stay
    // small, except where scattered slivers or the azimuth of a small cap multiply them.
    EXPECT_LT(steepest, 1e3);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets,
                         Triangulation,
                         ::testing::ValuesIn(surface_sets()),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

// Across the border itself, where the two formulas meet.
TEST(SphericalInterpolation, MeetsItselfAtTheBorder) {
  const DirectionSet set = scattered(60, 21, 0.3);
  const SphericalInterpolator lights(set, DirectionRole::kLight);
  Pcg32 random(22);
  for (int i = 0; i < 2000; ++i) {
    const double phi = 2.0 * kPi * random.uniform();
    double inner = 0.0;
    double outer = kPi / 2.0;
    // Bisect for the first theta at which the third weight vanishes for good.
    for (int step = 0; step < 45; ++step) {
      const double middle = 0.5 * (inner + outer);
      const DirectionWeights w = lights.weights(direction_from_angles({middle, phi}));
      (w.index[1] == w.index[2] ? outer : inner) = middle;
    }
    const auto value = [&](double theta) {
      const DirectionWeights w = lights.weights(direction_from_angles({theta, phi}));
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        sum += w.weight[k] * set[static_cast<std::size_t>(w.index[k])].x();
      return w.scale * sum;
    };
    // Thin triangles at the border multiply the step of 1e-9 by at most some thousands.
    EXPECT_NEAR(value(inner - 1e-9), value(outer + 1e-9), 1e-5) << phi;
  }
}

TEST(SphericalInterpolation, BonnHas81DirectionsIn136Triangles) {
  // Euler: 2 * 81 - 2 - 24 border vertices.
  const SphericalInterpolator bonn(bonn_directions(), DirectionRole::kView);
  EXPECT_EQ(bonn.triangles().size(), 136U);
}

TEST(SphericalInterpolation, ViewBeyondTheLastRingIsClampedAtItsAzimuth) {
  const SphericalInterpolator views(bonn_directions(), DirectionRole::kView);
  for (double phi = 0.0; phi < 360.0; phi += 3.7) {
    const DirectionWeights at_80 =
        views.weights(direction_from_angles({80 * kDegree, phi * kDegree}));
    const DirectionWeights below =
        views.weights(direction_from_angles({100 * kDegree, phi * kDegree}));
    Direction mean = Direction::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      mean += at_80.weight[k] * bonn_directions()[static_cast<std::size_t>(at_80.index[k])];
      EXPECT_NEAR(at_80.weight[k], below.weight[k], kRounding);
    }
    EXPECT_NEAR(angles_from_direction(mean).phi, phi * kDegree, kRounding);
    EXPECT_EQ(below.scale, 1.0);
  }
}

TEST(SphericalInterpolation, LightBeyondTheLastRingFallsLikeItsCosine) {
  const SphericalInterpolator lights(bonn_directions(), DirectionRole::kLight);
  for (double phi = 0.0; phi < 360.0; phi += 3.7) {
    for (const double theta : {75.0001, 80.0, 89.0, 89.9999}) {
      const double scale =
          lights.weights(direction_from_angles({theta * kDegree, phi * kDegree})).scale;
      EXPECT_NEAR(scale, std::cos(theta * kDegree) / std::cos(75.0 * kDegree), kRounding);
    }
    EXPECT_EQ(lights.weights(direction_from_angles({91 * kDegree, phi * kDegree})).scale, 0.0);
  }
  EXPECT_EQ(lights.weights(-Direction::UnitZ()).scale, 0.0);
}

// Border at theta 90: cos / cos would be 0 / 0.
TEST(SphericalInterpolation, BorderOnTheHorizonNeedsNoQuotient) {
  const SphericalInterpolator lights(rings({{0, 1}, {45, 8}, {90, 8}}), DirectionRole::kLight);
  for (double phi = 0.0; phi < 360.0; phi += 1.3) {
    for (const double theta : {89.0, 89.999999, 90.0 - 1e-10}) {
      const DirectionWeights w =
          lights.weights(direction_from_angles({theta * kDegree, phi * kDegree}));
      EXPECT_EQ(w.scale, 1.0) << theta << " " << phi;
    }
    const DirectionWeights below =
        lights.weights(direction_from_angles({90.001 * kDegree, phi * kDegree}));
    EXPECT_EQ(below.scale, 0.0);
    const DirectionWeights on =
        lights.weights(direction_from_angles({90 * kDegree, phi * kDegree}));
    EXPECT_TRUE(std::isfinite(on.scale));
    EXPECT_TRUE(on.scale == 0.0 || on.scale == 1.0);
  }
}

TEST(SphericalInterpolation, OneDirectionIsGivenAlways) {
  const Direction alone = direction_from_angles({30 * kDegree, 1.0});
  const SphericalInterpolator views({alone}, DirectionRole::kView);
  const SphericalInterpolator lights({alone}, DirectionRole::kLight);
  Pcg32 random(8);
  for (int i = 0; i < 200; ++i) {
    const Direction d = testing::random_direction(random, -1.0);
    const DirectionWeights view = views.weights(d);
    EXPECT_EQ(view.index[0], 0);
    EXPECT_EQ(view.weight[0] + view.weight[1] + view.weight[2], 1.0);
    EXPECT_EQ(view.scale, 1.0);
    const double cosine = std::max(d.z(), 0.0);
    EXPECT_NEAR(lights.weights(d).scale, std::min(1.0, cosine / alone.z()), kRounding);
  }
}

// Two directions, and a row of them through the normal in mixed order: the nearest point of the
// arc.
TEST(SphericalInterpolation, DirectionsOnAGreatCircleGiveTheArc) {
  const auto tilted = [](double degrees) {
    return direction_from_angles({std::abs(degrees) * kDegree, degrees < 0 ? kPi : 0.0});
  };
  for (const std::vector<double>& row :
       {std::vector<double>{-20.0, 50.0}, {10.0, -60.0, 70.0, 0.0, -30.0, 40.0}}) {
    DirectionSet set;
    for (const double degrees : row) set.push_back(tilted(degrees));
    const SphericalInterpolator views(set, DirectionRole::kView);
    EXPECT_TRUE(views.triangles().empty());
    const auto [lowest, highest] = std::minmax_element(row.begin(), row.end());
    Pcg32 random(9);
    for (int i = 0; i < 500; ++i) {
      // Off the arc by a turn about the tangent: the nearest point stays the same.
      const double degrees = -85.0 + 170.0 * random.uniform();
      const double off = (random.uniform() - 0.5) * 1.0;
      const Direction d = std::cos(off) * tilted(degrees) + std::sin(off) * Direction::UnitY();
      const DirectionWeights w = views.weights(d);
      Direction mean = Direction::Zero();
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k) {
        mean += w.weight[k] * set[static_cast<std::size_t>(w.index[k])];
        sum += w.weight[k];
      }
      EXPECT_NEAR(sum, 1.0, kRounding);
      const Direction expected = tilted(std::clamp(degrees, *lowest, *highest));
      EXPECT_LT((mean.normalized() - expected).norm(), 1e-9) << degrees;
    }
  }
}

TEST(SphericalInterpolation, HorizonEndToEndHasNoTriangle) {
  // Opposite ends and the normal: the great circle through them is one, their own is not.
  const SphericalInterpolator lights({Direction::UnitX(), Direction::UnitZ(), -Direction::UnitX()},
                                     DirectionRole::kLight);
  EXPECT_TRUE(lights.triangles().empty());
  const DirectionWeights w = lights.weights(direction_from_angles({45 * kDegree, kPi}));
  double z = 0.0;
  for (std::size_t k = 0; k < 3; ++k) z += w.weight[k] * (w.index[k] == 1 ? 1.0 : 0.0);
  EXPECT_NEAR(z, 0.5, kRounding);
}

// The order of a set may decide diagonals of cocircular quadrilaterals, nothing else.
TEST(SphericalInterpolation, OrderDoesNotMatterWhereTheTriangulationIsUnique) {
  const DirectionSet set = scattered(50, 31, 0.1);
  const DirectionSet reversed(set.rbegin(), set.rend());
  const SphericalInterpolator a(set, DirectionRole::kView);
  const SphericalInterpolator b(reversed, DirectionRole::kView);
  Pcg32 random(32);
  for (int i = 0; i < 1000; ++i) {
    const Direction d = testing::random_direction(random);
    const auto value = [&d](const SphericalInterpolator& s, const DirectionSet& of) {
      const DirectionWeights w = s.weights(d);
      double sum = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        sum += w.weight[k] * of[static_cast<std::size_t>(w.index[k])].y();
      return sum;
    };
    EXPECT_NEAR(value(a, set), value(b, reversed), 1e-9);
  }
}

}  // namespace
}  // namespace veneer::btf
