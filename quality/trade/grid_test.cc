// SPDX-License-Identifier: Apache-2.0
#include "quality/trade/grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace veneer::quality {
namespace {

btf::SampleSetInfo info(int side, bool polarised) {
  btf::SampleSetInfo set;
  set.width = set.height = side;
  set.polarised = polarised;
  return set;
}

std::vector<Candidate> all_of(const btf::SampleSetInfo& set, Grid grid) {
  return candidates_of(set, {.grid = grid}).value();
}

std::set<std::string> models_in(const std::vector<Candidate>& candidates) {
  std::set<std::string> models;
  for (const Candidate& c : candidates) models.insert(c.model);
  return models;
}

TEST(Grid, HasEveryModelThatTheSetAllows) {
  for (const Grid grid : {Grid::kCoarse, Grid::kFine}) {
    for (const bool polarised : {false, true}) {
      std::set<std::string> allowed;
      for (const btf::Model& model : btf::models())
        if (polarised || !model.polarised) allowed.emplace(model.name);
      EXPECT_EQ(models_in(all_of(info(64, polarised), grid)), allowed);
    }
  }
}

TEST(Grid, ListsEachWayToDrawOnce) {
  for (const Grid grid : {Grid::kCoarse, Grid::kFine}) {
    std::set<std::string> keys;
    std::set<std::string> names;
    for (const Candidate& c : all_of(info(64, true), grid)) {
      EXPECT_TRUE(keys.insert(c.key()).second) << c.key();
      EXPECT_TRUE(names.insert(c.name()).second) << c.name();
    }
  }
}

TEST(Grid, PutsWhatSharesAFitSideBySide) {
  std::set<std::string> finished;
  std::string last;
  for (const Candidate& c : all_of(info(64, true), Grid::kFine)) {
    if (c.fit_key() == last) continue;
    EXPECT_FALSE(finished.contains(c.fit_key())) << c.fit_key();
    finished.insert(last);
    last = c.fit_key();
  }
}

TEST(Grid, VariesEverySize) {
  for (const Grid grid : {Grid::kCoarse, Grid::kFine}) {
    const auto candidates = all_of(info(64, true), grid);
    const auto values = [&](auto of) {
      std::set<decltype(of(candidates.front()))> set;
      for (const Candidate& c : candidates) set.insert(of(c));
      return set.size();
    };
    EXPECT_GE(values([](const Candidate& c) { return c.fit.components; }), 5U);
    EXPECT_GE(values([](const Candidate& c) { return c.fit.clusters; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.fit.lobes; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.fit.layers; }), 4U);  // 0: other models'
    EXPECT_GE(values([](const Candidate& c) { return c.fit.angular; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.fit.precision; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.drawing.cache.spacing; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.drawing.average_texels; }), 2U);
    EXPECT_GE(values([](const Candidate& c) { return c.drawing.scale; }), 2U);
  }
}

TEST(Grid, HoldsOnlyWhatAFitAndARendererTake) {
  for (const int side : {1, 3, 64}) {
    for (const Grid grid : {Grid::kCoarse, Grid::kFine}) {
      for (const Candidate& c : all_of(info(side, true), grid)) {
        EXPECT_TRUE(c.fit.check()) << c.name();
        EXPECT_TRUE(c.drawing.check()) << c.name();
        if (reads_of(c.model).clusters) {
          EXPECT_LE(c.fit.clusters, side * side) << c.name();
        }
      }
    }
  }
}

TEST(Grid, IsOfMinutesOrOfHours) {
  const auto coarse = all_of(info(64, true), Grid::kCoarse);
  const auto fine = all_of(info(64, true), Grid::kFine);
  EXPECT_GT(coarse.size(), 40U);
  EXPECT_LT(coarse.size(), 90U);
  EXPECT_GT(fine.size(), 3 * coarse.size());
  EXPECT_LT(fine.size(), 1000U);
}

TEST(Grid, KeepsToTheModelsThatAreNamed) {
  const auto all = all_of(info(64, false), Grid::kCoarse);
  const std::vector<std::string> named{"texel-colours", "phong"};
  std::vector<std::string> expected;
  for (const Candidate& c : all)
    if (std::ranges::find(named, c.model) != named.end()) expected.push_back(c.key());
  std::vector<std::string> keys;
  const auto chosen = candidates_of(info(64, false), {.models = named});
  ASSERT_TRUE(chosen);
  for (const Candidate& c : *chosen) keys.push_back(c.key());
  EXPECT_EQ(keys, expected);
  EXPECT_LT(keys.size(), all.size());
  EXPECT_GT(keys.size(), 6U);
}

TEST(Grid, RefusesModelsThatCannotBeMeasured) {
  const auto unknown = candidates_of(info(64, false), {.models = {"fresnel"}});
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().what.find("fresnel"), std::string::npos);
  for (const btf::Model& model : btf::models()) {
    const GridOptions only{.models = {std::string(model.name)}};
    EXPECT_TRUE(candidates_of(info(64, true), only)) << model.name;
    EXPECT_EQ(candidates_of(info(64, false), only).has_value(), !model.polarised) << model.name;
  }
}

TEST(Grid, HasANameThatReadsBack) {
  for (const Grid grid : {Grid::kCoarse, Grid::kFine}) EXPECT_EQ(parse_grid(name_of(grid)), grid);
  const auto unknown = parse_grid("medium");
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().what.find("coarse or fine"), std::string::npos);
}

}  // namespace
}  // namespace veneer::quality
