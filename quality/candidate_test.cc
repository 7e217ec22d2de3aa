// SPDX-License-Identifier: Apache-2.0
#include "quality/candidate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "base/random.h"
#include "btf/fit_region.h"

namespace veneer::quality {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TradePoint point(double ms, double de00, double mb = 1) {
  TradePoint p;
  p.candidate.model = "phong";
  p.ms_median = ms;
  p.received_de00_mean = de00;
  p.gpu_bytes = mb * 1e6;
  return p;
}

bool beats(const TradePoint& a, const TradePoint& b) {
  return a.ms_median <= b.ms_median && a.received_de00_mean <= b.received_de00_mean &&
         (a.ms_median < b.ms_median || a.received_de00_mean < b.received_de00_mean);
}

std::vector<std::size_t> front_of(std::span<const TradePoint> points) {
  return pareto_front(points, &TradePoint::ms_median, &TradePoint::received_de00_mean, 0);
}

// Few distinct values, so that ties are common.
std::vector<TradePoint> random_points(Pcg32& random, int count) {
  std::vector<TradePoint> points;
  for (int i = 0; i < count; ++i)
    points.push_back(point(std::floor(8 * random.uniform()), std::floor(8 * random.uniform())));
  return points;
}

TEST(ParetoFront, HoldsExactlyThosePointsThatNoOtherBeats) {
  Pcg32 random(11);
  for (int trial = 0; trial < 300; ++trial) {
    const std::vector<TradePoint> points = random_points(random, trial % 40);
    const std::vector<std::size_t> front = front_of(points);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool beaten =
          std::ranges::any_of(points, [&](const TradePoint& p) { return beats(p, points[i]); });
      const bool on_front = std::ranges::find(front, i) != front.end();
      EXPECT_EQ(on_front, !beaten) << "trial " << trial << ", point " << i;
    }
  }
}

TEST(ParetoFront, IsSortedByCost) {
  Pcg32 random(12);
  for (int trial = 0; trial < 100; ++trial) {
    const std::vector<TradePoint> points = random_points(random, 30);
    const std::vector<std::size_t> front = front_of(points);
    EXPECT_TRUE(
        std::ranges::is_sorted(front, {}, [&](std::size_t i) { return points[i].ms_median; }));
  }
}

TEST(ParetoFront, DoesNotDependOnTheOrderOfThePoints) {
  Pcg32 random(13);
  const auto values = [](std::span<const TradePoint> points) {
    std::multiset<std::pair<double, double>> set;
    for (const std::size_t i : front_of(points))
      set.emplace(points[i].ms_median, points[i].received_de00_mean);
    return set;
  };
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<TradePoint> points = random_points(random, 25);
    const auto before = values(points);
    for (std::size_t i = points.size(); i > 1; --i)
      std::swap(points[i - 1], points[static_cast<std::size_t>(random.uniform() * double(i))]);
    EXPECT_EQ(values(points), before) << "trial " << trial;
  }
}

TEST(ParetoFront, LeavesOutWhatIsNotFinite) {
  const std::vector<TradePoint> points{point(kNan, 0),
                                       point(0, kNan),
                                       point(kInfinity, 0),
                                       point(0, kInfinity),
                                       point(-kInfinity, 5),
                                       point(2, 3)};
  EXPECT_EQ(front_of(points), (std::vector<std::size_t>{5}));
}

TEST(ParetoFront, KeepsBothOfTwoEqualPoints) {
  const std::vector<TradePoint> points{point(1, 1), point(2, 0.5), point(1, 1), point(2, 1)};
  EXPECT_EQ(front_of(points), (std::vector<std::size_t>{0, 2, 1}));
}

TEST(ParetoFront, TakesNothingDearerForAGainThatNobodySees) {
  Pcg32 random(15);
  constexpr double kGain = 0.25;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<TradePoint> points;
    for (int i = 0; i < trial % 40; ++i)
      points.push_back(point(random.uniform(), random.uniform()));
    const std::vector<std::size_t> front =
        pareto_front(points, &TradePoint::ms_median, &TradePoint::received_de00_mean, kGain);
    for (std::size_t k = 1; k < front.size(); ++k)
      EXPECT_GE(points[front[k - 1]].received_de00_mean - points[front[k]].received_de00_mean,
                kGain);
    // What is not on it is at most that much nearer than something on it that costs no more.
    for (const TradePoint& p : points)
      EXPECT_TRUE(std::ranges::any_of(front,
                                      [&](std::size_t i) {
                                        return points[i].ms_median <= p.ms_median &&
                                               points[i].received_de00_mean <=
                                                   p.received_de00_mean + kGain;
                                      }))
          << "trial " << trial;
  }
}

TEST(ParetoFront, OfReportsHasATolerance) {
  const std::vector<TradePoint> points{
      point(1, 0.5), point(2, 0.5 - 0.9 * kLeastGain), point(3, 0.5 - 1.1 * kLeastGain)};
  EXPECT_EQ(pareto_front(points, &TradePoint::ms_median), (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(front_of(points), (std::vector<std::size_t>{0, 1, 2}));
}

TradePoint cached(TradePoint p, double served) {
  p.candidate.model = "lpca";
  p.candidate.drawing.cache.spacing = 16;
  p.cache_served = served;
  return p;
}

TEST(ParetoFront, LeavesOutACacheThatServesNothing) {
  // The idle one is the cheapest by the noise of a clock.
  const std::vector<TradePoint> points{cached(point(1, 0.5), 0),
                                       point(1.01, 0.5),
                                       cached(point(0.5, 0.6), 0.4),
                                       cached(point(0.4, 0.7), kNan)};
  EXPECT_EQ(front_of(points), (std::vector<std::size_t>{3, 2, 1}));
  EXPECT_EQ(choose(points, {}).value(), 1U);
  EXPECT_TRUE(points[0].has_idle_cache());
  EXPECT_TRUE(cached(point(1, 1), 0.0099).has_idle_cache());
  EXPECT_FALSE(cached(point(1, 1), 0.01).has_idle_cache());
  EXPECT_FALSE(point(1, 1).has_idle_cache());
  // A share that was noted of a way without a cache is of nothing.
  TradePoint off = cached(point(1, 1), 0);
  off.candidate.drawing.cache.spacing = 0;
  EXPECT_FALSE(off.has_idle_cache());
}

TEST(ParetoFront, OfNothingIsEmpty) { EXPECT_TRUE(front_of({}).empty()); }

TEST(Choose, FindsTheLeastErrorThatKeepsToEveryBound) {
  Pcg32 random(14);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<TradePoint> points;
    for (int i = 0; i < 20; ++i)
      points.push_back(point(std::floor(6 * random.uniform()),
                             std::floor(6 * random.uniform()),
                             std::floor(6 * random.uniform())));
    const Budget budget{.ms = 3, .mb = 4, .de00 = {}};
    const auto keeps = [&](const TradePoint& p) { return p.ms_median <= 3 && p.gpu_bytes <= 4e6; };
    const auto chosen = choose(points, budget);
    ASSERT_EQ(chosen.has_value(), std::ranges::any_of(points, keeps));
    if (!chosen) continue;
    const TradePoint& best = points[*chosen];
    EXPECT_TRUE(keeps(best));
    for (const TradePoint& p : points) {
      if (keeps(p)) {
        EXPECT_LE(std::tuple(best.received_de00_mean, best.ms_median, best.gpu_bytes),
                  std::tuple(p.received_de00_mean, p.ms_median, p.gpu_bytes))
            << "trial " << trial;
      }
    }
  }
}

TEST(Choose, FindsTheCheapestWhereOnlyTheErrorIsBounded) {
  const std::vector<TradePoint> points{point(9, 0.1), point(3, 0.8), point(2, 1.2), point(4, 0.5)};
  EXPECT_EQ(choose(points, {.ms = {}, .mb = {}, .de00 = 1}).value(), 1U);
  // With another bound the error counts again.
  EXPECT_EQ(choose(points, {.ms = 5, .mb = {}, .de00 = 1}).value(), 3U);
  EXPECT_EQ(choose(points, {}).value(), 0U);
}

TEST(Choose, TakesTheCheaperOfTwoThatNobodyTellsApart) {
  const std::vector<TradePoint> points{
      point(9, 0.5), point(3, 0.5 + 0.9 * kLeastGain), point(1, 0.5 + 1.1 * kLeastGain)};
  EXPECT_EQ(choose(points, {}).value(), 1U);
  EXPECT_EQ(choose(points, {.ms = 10, .mb = {}, .de00 = 0.505}).value(), 0U);
}

TEST(Choose, TakesABoundAsReached) {
  const std::vector<TradePoint> points{point(3, 1, 2)};
  EXPECT_TRUE(choose(points, {.ms = 3, .mb = 2, .de00 = 1}));
}

TEST(Choose, NamesTheNearestMissOfEachBound) {
  std::vector<TradePoint> points{point(5, 0.1, 9), point(4, 0.9, 1), point(6, 0.2, 2)};
  points[0].candidate.fit.lobes = 1;
  points[0].candidate.model = "lafortune";
  points[2].candidate.model = "lpca";
  const auto none = choose(points, {.ms = 5, .mb = 1.5, .de00 = 0.5});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kInvalidOption);
  for (const char* part :
       {"5 ms and 1.5 MB and 0.5 dE00",
        "the least MB that keeps to the rest is 9 (lafortune 1 lobe; 7.5 MB over)",
        "the least dE00 that keeps to the rest is 0.9 (phong; 0.4 dE00 over)",
        "the least ms, though it misses another bound, is 4 (phong)"})
    EXPECT_NE(none.error().what.find(part), std::string::npos)
        << part << " in " << none.error().what;
  const auto alone = choose(points, {.ms = 1, .mb = {}, .de00 = {}});
  ASSERT_FALSE(alone);
  EXPECT_NE(alone.error().what.find("the least ms is 4 (phong; 3 ms over)"), std::string::npos)
      << alone.error().what;
}

TEST(Choose, RefusesWhatIsNoBudgetAndNoPoint) {
  const std::vector<TradePoint> points{point(1, 1)};
  for (const double bad : {-1.0, kNan}) {
    const auto refused = choose(points, {.ms = bad, .mb = {}, .de00 = {}});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  }
  for (const auto& none : {std::vector<TradePoint>{}, std::vector{point(kNan, 1)}}) {
    const auto refused = choose(none, {});
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().what.find("none was measured"), std::string::npos);
  }
}

TEST(Candidate, NamesOnlyWhatIsReadAndUnusual) {
  Candidate c{"texel-colours", {}, {}};
  c.fit.components = "3+1";
  c.fit.lobes = 4;  // not read
  EXPECT_EQ(c.name(), "texel-colours 3+1");
  c.fit.clusters = 16;
  c.drawing.cache.spacing = 16;
  c.drawing.scale = 0.5;
  EXPECT_EQ(c.name(), "texel-colours 3+1, 16 clusters, cache 16, scale 0.5");
  Candidate phong{"phong", {}, {}};
  phong.fit.clusters = 3;
  phong.drawing.cache.spacing = 8;  // it offers no cache
  EXPECT_EQ(phong.name(), "phong");
  Candidate layered{"layered", {}, {}};
  layered.fit.clusters = 3;
  EXPECT_EQ(layered.name(), "layered");
  layered.fit.layers = 1;
  EXPECT_EQ(layered.name(), "layered 1 layer");
  layered.fit.layers = 4;
  layered.fit.heights = btf::HeightRange{-0.5, 2};
  EXPECT_EQ(layered.name(), "layered 4 layers, heights -0.5 to 2");
}

// Every way in which two candidates can differ.
std::vector<Candidate> all_different() {
  static const btf::FitRegion whole;
  static const btf::FitRegion half{{}, {0, 0.5, 0, 1}, {}};
  std::vector<Candidate> all;
  const auto add = [&all](std::string model, auto change) {
    Candidate c{std::move(model), {}, {}};
    c.fit.components = "3+1";
    change(c);
    all.push_back(std::move(c));
  };
  for (const char* model : {"texel-colours", "dichromatic-lpca"}) {
    add(model, [](Candidate&) {});
    add(model, [](Candidate& c) { c.fit.components = "31"; });
    add(model, [](Candidate& c) { c.fit.clusters = 8; });
    add(model, [](Candidate& c) { c.fit.angular = 8; });
    add(model, [](Candidate& c) { c.fit.seed = 8; });
    add(model, [](Candidate& c) { c.fit.basis = 8; });
    add(model, [](Candidate& c) { c.fit.iterations = 8; });
    add(model, [](Candidate& c) { c.fit.region = &whole; });
    add(model, [](Candidate& c) { c.fit.region = &half; });
    add(model, [](Candidate& c) { c.drawing.cache.spacing = 8; });
    add(model, [](Candidate& c) { c.drawing.cache = {.spacing = 8, .most_turn = 0.2}; });
    add(model, [](Candidate& c) { c.drawing.average_texels = true; });
    add(model, [](Candidate& c) { c.drawing.evaluation = render::Evaluation::kCompute; });
    add(model, [](Candidate& c) { c.drawing.scale = 0.5; });
  }
  add("texel-colours", [](Candidate& c) { c.fit.mip_levels = 2; });
  for (const char* text : {"a-b", "a.b", "ab", "a b", "a/b"}) {
    add("dichromatic-lpca", [text](Candidate& c) { c.fit.form = text; });
    add("dichromatic-lpca", [text](Candidate& c) { c.fit.specular = text; });
    add("dichromatic-lpca", [text](Candidate& c) { c.fit.clustering = text; });
    add("revised-lpca", [text](Candidate& c) { c.fit.precision = text; });
  }
  add("lafortune", [](Candidate& c) { c.fit.lobes = 1; });
  add("lafortune", [](Candidate& c) { c.fit.lobes = 2; });
  add("layered", [](Candidate&) {});
  add("layered", [](Candidate& c) { c.fit.layers = 1; });
  add("layered", [](Candidate& c) { c.fit.layers = 4; });
  for (const btf::HeightRange& heights :
       {btf::HeightRange{0, 1}, {-1, 1}, {0.1, 1}, {0.1 + 1e-12, 1}, {-1e-9, 1}})
    add("layered", [heights](Candidate& c) { c.fit.heights = heights; });
  return all;
}

TEST(Candidate, HasAKeyOfItsOwnThatCanNameAFile) {
  std::set<std::string> keys;
  for (const Candidate& c : all_different()) {
    EXPECT_TRUE(keys.insert(c.key()).second) << c.key();
    EXPECT_EQ(c.key(), Candidate(c).key());
    EXPECT_EQ(c.key().find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
                                        "0123456789-.+"),
              std::string::npos)
        << c.key();
  }
}

TEST(Candidate, SharesAMaterialWithThoseThatAreOnlyDrawnOtherwise) {
  Candidate a{"lpca", {}, {}};
  Candidate b = a;
  b.drawing = {.cache = {.spacing = 8}, .average_texels = true, .scale = 0.25};
  EXPECT_EQ(a.fit_key(), b.fit_key());
  EXPECT_NE(a.key(), b.key());
  b.fit.clusters = 7;
  EXPECT_NE(a.fit_key(), b.fit_key());
}

TEST(Candidate, IsTheSameWhateverItsModelDoesNotRead) {
  Candidate a{"phong", {}, {}};
  Candidate b = a;
  b.fit.clusters = 3;
  b.fit.components = "9";
  b.fit.form = "x";
  b.fit.lobes = 4;
  b.fit.layers = 4;
  b.fit.heights = btf::HeightRange{0, 1};
  EXPECT_EQ(a.key(), b.key());
}

}  // namespace
}  // namespace veneer::quality
