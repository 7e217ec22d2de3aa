// SPDX-License-Identifier: Apache-2.0
#include "quality/ladder.h"

#include <gtest/gtest.h>

#include <array>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::quality {
namespace {

namespace fs = std::filesystem;

Ladder random_ladder(Pcg32& random, const fs::path& folder) {
  Ladder ladder;
  const int count = 1 + static_cast<int>(random.uniform() * Ladder::kMost);
  double ratio = 20 + random.uniform();
  double error = random.uniform();
  for (int i = 0; i < count; ++i) {
    Rung rung;
    rung.name = fmt::format("a \"quoted\" \\ name\n{}", i);
    rung.material = folder / "materials" / fmt::format("m {}.safetensors", i);
    rung.ratio = ratio;
    rung.de00_mean = error;
    rung.drawing.average_texels = random.uniform() < 0.5;
    if (random.uniform() < 0.5) rung.drawing.cache = {.spacing = 8, .most_turn = random.uniform()};
    if (random.uniform() < 0.5) rung.drawing.evaluation = render::Evaluation::kCompute;
    if (random.uniform() < 0.5) rung.drawing.scale = 0.25 + 0.75 * random.uniform();
    ladder.rungs.push_back(rung);
    ratio *= 0.3 + 0.5 * random.uniform();
    error += random.uniform();
  }
  return ladder;
}

TEST(Ladder, ComesBackAsItWasSaved) {
  const TemporaryFolder folder;
  Pcg32 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Ladder ladder = random_ladder(random, folder.path());
    const fs::path file = folder.path() / "ladder.toml";
    ASSERT_TRUE(ladder.save(file));
    const auto loaded = Ladder::load(file);
    ASSERT_TRUE(loaded) << loaded.error().what;
    ASSERT_EQ(loaded->rungs.size(), ladder.rungs.size());
    for (std::size_t i = 0; i < ladder.rungs.size(); ++i) {
      const Rung& a = loaded->rungs[i];
      const Rung& b = ladder.rungs[i];
      EXPECT_EQ(a.name, b.name);
      EXPECT_EQ(a.material, b.material);
      EXPECT_EQ(a.ratio, b.ratio);
      EXPECT_EQ(a.de00_mean, b.de00_mean);
      EXPECT_EQ(a.drawing.average_texels, b.drawing.average_texels);
      EXPECT_EQ(a.drawing.cache.spacing, b.drawing.cache.spacing);
      EXPECT_EQ(a.drawing.cache.most_turn, b.drawing.cache.most_turn);
      EXPECT_EQ(a.drawing.evaluation, b.drawing.evaluation);
      EXPECT_EQ(a.drawing.scale, b.drawing.scale);
    }
  }
}

TEST(Ladder, MovesWithItsFolder) {
  const TemporaryFolder folder;
  Pcg32 random(4);
  const fs::path before = folder.path() / "before";
  ASSERT_TRUE(random_ladder(random, before).save(before / "ladder.toml"));
  const fs::path after = folder.path() / "after";
  fs::rename(before, after);
  const auto loaded = Ladder::load(after / "ladder.toml");
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_EQ(loaded->rungs.front().material.parent_path(), after / "materials");
}

struct Refused {
  std::string text;
  std::string why;
};

TEST(Ladder, RefusesWhatCannotBeSteppedAlong) {
  const std::string rung = "[[rung]]\nname = \"a\"\nmaterial = \"a.safetensors\"\nde00_mean = 1\n";
  std::string many;
  for (std::size_t i = 0; i <= Ladder::kMost; ++i)
    many += rung + fmt::format("ratio = {}\n", 99 - i);
  std::string mistaken;
  for (std::size_t i = 0; i <= Ladder::kMost; ++i) mistaken += "[[rung]]\n";
  const Refused cases[] = {
      {"", "no rungs"},
      {many, "over 8"},
      {mistaken, "over 8"},  // and not a word on each of them
      {rung, "ratio"},
      {rung + "ratio = 0\n", "above 0"},
      {rung + "ratio = nan\n", "a finite number"},
      {rung + "ratio = 2\n" + rung + "ratio = 2\n", "costs must descend"},
      {rung + "ratio = 2\n" + rung + "ratio = 3\n", "costs must descend"},
      {rung + "ratio = 2\n[[rung]]\nname = \"b\"\nmaterial = \"b\"\nde00_mean = 0.5\nratio = 1\n",
       "take that one out"},
      {rung + "ratio = 2\nscale = 0.1\n", "scale"},
      {rung + "ratio = 2\ncache_spacing_px = 3\n", "cache"},
      {rung + "ratio = 2\nevaluation = \"magic\"\n", "magic"},
      {rung + "ratio = 2\ncache_spacing = 16\n", "cache_spacing_px"},
      {"[[rung]]\nname = \"a\"\nmaterial = \"\"\nde00_mean = 1\nratio = 1\n", "names no material"},
  };
  const TemporaryFolder folder;
  for (const Refused& c : cases) {
    const fs::path file = folder.path() / "ladder.toml";
    ASSERT_TRUE(write_text(file, c.text));
    const auto loaded = Ladder::load(file);
    ASSERT_FALSE(loaded) << c.text;
    EXPECT_EQ(loaded.error().code, Errc::kInvalidOption) << loaded.error().what;
    EXPECT_NE(loaded.error().what.find(c.why), std::string::npos) << loaded.error().what;
    EXPECT_NE(loaded.error().what.find("ladder.toml"), std::string::npos) << loaded.error().what;
  }
  const auto absent = Ladder::load(folder.path() / "absent.toml");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, Errc::kNotFound);
}

TEST(Ladder, IsNotWrittenWhereItCouldNotBeRead) {
  const TemporaryFolder folder;
  EXPECT_FALSE(Ladder{}.save(folder.path() / "ladder.toml"));
  EXPECT_FALSE(fs::exists(folder.path() / "ladder.toml"));
}

TEST(LadderOf, TakesOffOneThingAfterAnotherAndCanBeSaved) {
  const TemporaryFolder folder;
  for (const bool cache : {false, true}) {
    for (const bool average : {false, true}) {
      for (const double scale : {1.0, 0.6, 0.25}) {
        const Ladder ladder = ladder_of(folder.path() / "m.safetensors",
                                        cache,
                                        {.cache = {}, .average_texels = average, .scale = scale});
        const auto steps = static_cast<std::size_t>(cache) + static_cast<std::size_t>(average) +
                           (scale > 0.7   ? 2U
                            : scale > 0.5 ? 1U
                                          : 0U);
        EXPECT_EQ(ladder.rungs.size(), 1 + steps);
        EXPECT_EQ(ladder.rungs.front().drawing.average_texels, average);
        EXPECT_EQ(ladder.rungs.front().drawing.scale, scale);
        EXPECT_TRUE(ladder.save(folder.path() / "ladder.toml"));
      }
    }
  }
}

TEST(LadderOf, LeavesTheCacheOutWhereItWouldNotBeUsed) {
  const Ladder ladder =
      ladder_of("m", true, {.cache = {}, .evaluation = render::Evaluation::kCompute});
  for (const Rung& rung : ladder.rungs) EXPECT_EQ(rung.drawing.cache.spacing, 0);
}

TEST(LadderOfPoints, GoesDownTheFrontInClearStepsFromTheBest) {
  const TemporaryFolder folder;
  Pcg32 random(5);
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<TradePoint> points;
    for (int i = 0; i < 3 * trial; ++i) {
      TradePoint point;
      point.candidate.model = "lafortune";
      point.candidate.fit.lobes = i;
      point.ratio = 1 + 20 * random.uniform();
      point.ms_median = 7 * point.ratio;
      // Mostly along a front, so that there is something to be thinned.
      point.received_de00_mean = 4 / point.ratio + 0.1 * random.uniform();
      points.push_back(point);
    }
    const Ladder ladder = ladder_of(points, folder.path());
    ASSERT_LE(ladder.rungs.size(), Ladder::kMost);
    if (points.empty()) {
      EXPECT_TRUE(ladder.rungs.empty());
      continue;
    }
    const auto front = pareto_front(points, &TradePoint::ms_median);
    EXPECT_EQ(ladder.rungs.front().de00_mean, points[front.back()].received_de00_mean);
    for (std::size_t i = 1; i < ladder.rungs.size(); ++i)
      EXPECT_LE(ladder.rungs[i].ratio, 0.85 * ladder.rungs[i - 1].ratio);
    // The cheapest of all is hardly cheaper than the last rung.
    EXPECT_LT(0.4 * ladder.rungs.back().ratio, points[front.front()].ratio);
    const Status saved = ladder.save(folder.path() / "ladder.toml");
    EXPECT_TRUE(saved) << saved.error().what;
  }
}

TEST(LadderOfPoints, HasNoRungThatNobodyWouldSeeAndNoneWithAnIdleCache) {
  TradePoint good;
  good.candidate.model = "lpca";
  good.ms_median = good.ratio = 4;
  good.received_de00_mean = 0.5;
  TradePoint dearer = good;  // twice the time for what is not seen
  dearer.ms_median = dearer.ratio = 8;
  dearer.received_de00_mean = 0.495;
  TradePoint idle = good;
  idle.candidate.drawing.cache.spacing = 16;
  idle.cache_served = 0;
  idle.ms_median = idle.ratio = 3;
  const Ladder ladder = ladder_of(std::array{dearer, idle, good}, "m");
  ASSERT_EQ(ladder.rungs.size(), 1U);
  EXPECT_EQ(ladder.rungs.front().ratio, 4);
  EXPECT_EQ(ladder.rungs.front().drawing.cache.spacing, 0);
}

}  // namespace
}  // namespace veneer::quality
