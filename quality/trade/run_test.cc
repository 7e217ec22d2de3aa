// SPDX-License-Identifier: Apache-2.0
#include "quality/trade/run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "base/files.h"
#include "base/image_files.h"
#include "base/testing/full_disk.h"
#include "base/testing/temporary_folder.h"
#include "btf/internal_test_sets.h"

namespace veneer::quality {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A world with exact figures, which counts what it was asked.
struct World {
  explicit World(const fs::path& folder)
      : set(btf::testing::make_set(folder / "tiny.btfset", info(), [](int, int v, int l, int c) {
          return 0.1F + 0.05F * static_cast<float>(v) + 0.02F * static_cast<float>(l + c);
        })) {}

  static btf::SampleSetInfo info() {
    btf::SampleSetInfo set;
    set.width = set.height = 2;
    set.views = set.lights = btf::testing::ring(4, 0.8);
    return set;
  }

  TradeTools tools() {
    TradeTools t;
    t.fit = [this](const Candidate& c, Progress& progress) -> Result<TradeTools::MaterialPtr> {
      ++fits[c.fit_key()];
      if (c.fit_key() == refused_fit) return fail(Errc::kInvalidOption, "it does not fit");
      if (stop()) return fail(Errc::kCancelled, "stopped");
      auto material = (*btf::find_model(c.model))->fit(set, c.fit, progress);
      if (!material) return tl::unexpected(material.error());
      return TradeTools::MaterialPtr(std::move(*material));
    };
    t.set_errors = [this](const btf::Material& m, Progress&) -> Result<SetErrors> {
      if (stop()) return fail(Errc::kCancelled, "stopped");
      return SetErrors{0.25, 0.5, m.values_per_texel()};
    };
    t.look = [this](const Candidate& c, const btf::Material&) -> Result<Seen> {
      ++looks[c.key()];
      if (c.key() == refused_look) return fail(Errc::kInvalidOption, "it cannot be drawn");
      if (stop()) return fail(Errc::kCancelled, "stopped");
      Seen seen;
      seen.errors.target = {.epsilon = 0.125,
                            .rmse = 0.5,
                            .de00_mean = error_of(c),
                            .de00_p95 = 2 * error_of(c),
                            .de00_max = 3 * error_of(c)};
      seen.errors.received = {.de00_mean = error_of(c) + 1,
                              .de00_p95 = 2 * error_of(c) + 1,
                              .de00_max = 3 * error_of(c) + 1};
      seen.crop = Image<Rgb32f>(3, 2, Rgb32f(1, 2, 3));
      seen.de00 = Image<float>(3, 2, static_cast<float>(error_of(c)));
      return seen;
    };
    t.time = [this](std::span<const render::NamedLevel> levels,
                    Progress&) -> Result<render::RenderBenchResult> {
      ++timings;
      if (stop()) return fail(Errc::kCancelled, "stopped");
      render::RenderBenchResult result{.renderer = "a renderer", .clock = "a clock", .timings = {}};
      // Each run finds the machine twice as loaded as the one before it.
      const double load = static_cast<double>(1 << timings);
      result.timings.push_back({.name = "plain", .ms_median = load, .ratio = 1});
      for (const render::NamedLevel& level : levels) {
        const double ratio = 1 + 10 * level.level.drawing.scale;
        result.timings.push_back(
            {.name = level.name,
             .ms_median = load * ratio,
             .ms_p95 = 2 * load * ratio,
             .ratio = ratio,
             .fetches = 3,
             .gpu_bytes = 1000,
             .served = level.level.drawing.cache.spacing > 0 ? std::optional(0.25) : std::nullopt});
      }
      return result;
    };
    return t;
  }

  static double error_of(const Candidate& c) { return static_cast<double>(c.key().size()) / 8; }
  bool stop() { return steps_left > 0 && --steps_left == 0; }

  btf::SampleSet set;
  std::map<std::string, int> fits;
  std::map<std::string, int> looks;
  int timings = 0;
  int steps_left = 0;  // until it stops; 0: never
  std::string refused_fit;
  std::string refused_look;
};

std::vector<Candidate> few() {
  std::vector<Candidate> candidates;
  for (const char* model : {"phong", "lafortune", "lpca"}) {
    for (const double scale : {1.0, 0.5}) {
      Candidate c{model, {}, {}};
      c.fit.components = "2";
      c.fit.clusters = 1;
      c.fit.lobes = 1;
      c.drawing.scale = scale;
      candidates.push_back(c);
    }
  }
  return candidates;
}

class TradeRunTest : public ::testing::Test {
 protected:
  TradeRun options(const std::string& folder = "report") const {
    TradeRun run;
    run.folder = folder_.path() / folder;
    run.identity = {{"scene", "scene.toml 12"}, {"grid", "coarse"}};
    return run;
  }
  Result<Trade> run(World& world, const TradeRun& how) {
    SilentProgress progress;
    return run_trade(how, few(), world.tools(), progress);
  }
  TemporaryFolder folder_;
};

void expect_same_but_for_fit_time(const Trade& a, const Trade& b) {
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const TradePoint& p = a.points[i];
    const TradePoint& q = b.points[i];
    EXPECT_EQ(p.candidate.key(), q.candidate.key());
    EXPECT_EQ(p.ratio, q.ratio);
    EXPECT_EQ(p.gpu_bytes, q.gpu_bytes);
    EXPECT_EQ(p.fetches, q.fetches);
    EXPECT_EQ(p.set_epsilon, q.set_epsilon);
    EXPECT_EQ(p.set_rmse, q.set_rmse);
    EXPECT_EQ(p.set_de00_mean, q.set_de00_mean);
    EXPECT_EQ(p.screen_epsilon, q.screen_epsilon);
    EXPECT_EQ(p.screen_rmse, q.screen_rmse);
    EXPECT_EQ(p.de00_mean, q.de00_mean);
    EXPECT_EQ(p.de00_p95, q.de00_p95);
    EXPECT_EQ(p.de00_max, q.de00_max);
    EXPECT_EQ(p.received_de00_mean, q.received_de00_mean);
    EXPECT_EQ(p.received_de00_p95, q.received_de00_p95);
    EXPECT_EQ(p.received_de00_max, q.received_de00_max);
  }
}

TEST_F(TradeRunTest, MeasuresEveryCandidateAndFitsEachFitOnce) {
  World world(folder_.path());
  const auto trade = run(world, options());
  ASSERT_TRUE(trade) << trade.error().what;
  const std::vector<Candidate> candidates = few();
  ASSERT_EQ(trade->points.size(), candidates.size());
  EXPECT_EQ(world.fits.size(), 3U);
  for (const auto& [key, count] : world.fits) EXPECT_EQ(count, 1) << key;
  for (const auto& [key, count] : world.looks) EXPECT_EQ(count, 1) << key;
  EXPECT_EQ(world.timings, 1);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const TradePoint& p = trade->points[i];
    EXPECT_EQ(p.candidate.key(), candidates[i].key());
    EXPECT_EQ(p.ratio, 1 + 10 * candidates[i].drawing.scale);
    EXPECT_EQ(p.ms_median, 2 * p.ratio);
    EXPECT_EQ(p.ms_p95, 4 * p.ratio);
    EXPECT_EQ(p.gpu_bytes, 1000);
    EXPECT_EQ(p.set_epsilon, 0.25);
    EXPECT_EQ(p.set_rmse, 0.5);
    EXPECT_EQ(p.de00_mean, World::error_of(candidates[i]));
    EXPECT_EQ(p.received_de00_max, 3 * World::error_of(candidates[i]) + 1);
    EXPECT_GE(p.fit_seconds, 0);
    EXPECT_TRUE(btf::load_material(material_path(options().folder, candidates[i])));
    const auto crop = read_exr(crop_path(options().folder, candidates[i]));
    ASSERT_TRUE(crop);
    EXPECT_EQ(crop->size(), 4U);
  }
  EXPECT_EQ(trade->renderer, "a renderer");
  EXPECT_EQ(trade->clock, "a clock");
}

TEST_F(TradeRunTest, NotesWhatTheCacheServesAndKeepsIt) {
  Candidate plain{"lpca", {}, {}};
  plain.fit.components = "2";
  plain.fit.clusters = 1;
  Candidate cached = plain;
  cached.drawing.cache.spacing = 16;
  for (int time = 0; time < 2; ++time) {  // measured, then from the journal
    World world(folder_.path() / std::to_string(time));
    SilentProgress progress;
    const auto trade = run_trade(options(), std::array{plain, cached}, world.tools(), progress);
    ASSERT_TRUE(trade) << trade.error().what;
    EXPECT_EQ(world.timings, time == 0 ? 1 : 0);
    EXPECT_TRUE(std::isnan(trade->points[0].cache_served));
    EXPECT_EQ(trade->points[1].cache_served, 0.25);
  }
}

// Wherever it is stopped: what was done is not done again, and the result is the same.
TEST_F(TradeRunTest, GoesOnWhereItWasStopped) {
  World whole(folder_.path());
  const auto expected = run(whole, options("whole"));
  ASSERT_TRUE(expected);
  // 3 fits, 3 errors in the set, 6 looks and a timing.
  for (int steps = 1; steps <= 13; ++steps) {
    World world(folder_.path() / std::to_string(steps));
    const TradeRun how = options(fmt::format("stopped{}", steps));
    world.steps_left = steps;
    const auto stopped = run(world, how);
    ASSERT_FALSE(stopped) << steps;
    EXPECT_EQ(stopped.error().code, Errc::kCancelled);
    const auto trade = run(world, how);
    ASSERT_TRUE(trade) << trade.error().what;
    expect_same_but_for_fit_time(*trade, *expected);
    int repeated = 0;  // only what was under way
    for (const auto& [key, count] : world.fits) repeated += count - 1;
    for (const auto& [key, count] : world.looks) repeated += count - 1;
    repeated += world.timings - 1;
    EXPECT_EQ(repeated, 1) << steps;
    const auto again = run(world, how);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->fitted + again->looked, 0);
    EXPECT_EQ(again->points.front().ms_median, trade->points.front().ms_median);
    EXPECT_EQ(again->points.front().fit_seconds, trade->points.front().fit_seconds);
  }
}

TEST_F(TradeRunTest, GoesOnWhereverItsJournalWasCut) {
  World world(folder_.path());
  const auto expected = run(world, options());
  ASSERT_TRUE(expected);
  const fs::path file = options().folder / "journal.jsonl";
  const std::string text = read_text(file).value();
  // Every few bytes, and about each end of a line.
  for (std::size_t length = 0; length <= text.size(); ++length) {
    const bool near_end =
        text.substr(length < 1 ? 0 : length - 1, 3).find('\n') != std::string::npos;
    if (!near_end && length % 197 != 0) continue;
    ASSERT_TRUE(write_text(file, text.substr(0, length)));
    const auto trade = run(world, options());
    ASSERT_TRUE(trade) << length << ": " << trade.error().what;
    expect_same_but_for_fit_time(*trade, *expected);
  }
}

TEST_F(TradeRunTest, MakesAnewWhatWasTakenAwayOrDamaged) {
  World world(folder_.path());
  ASSERT_TRUE(run(world, options()));
  const Candidate first = few().front();
  ASSERT_TRUE(write_text(material_path(options().folder, first), "damaged"));
  fs::remove(crop_path(options().folder, few().back()));
  const auto trade = run(world, options());
  ASSERT_TRUE(trade) << trade.error().what;
  EXPECT_EQ(trade->fitted, 1);
  EXPECT_EQ(trade->looked, 1);
  EXPECT_EQ(world.fits[first.fit_key()], 2);
  EXPECT_EQ(world.looks[few().back().key()], 2);
}

TEST_F(TradeRunTest, RefusesAnotherScenesJournalAndSaysWhatDiffers) {
  World world(folder_.path());
  ASSERT_TRUE(run(world, options()));
  for (const auto& [name, value] :
       {std::pair("scene", "scene.toml 13"), std::pair("grid", "fine")}) {
    TradeRun other = options();
    for (auto& each : other.identity)
      if (each.first == name) each.second = value;
    const auto refused = run(world, other);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    for (const char* part : {name, value, "another folder"})
      EXPECT_THAT(refused.error().what, HasSubstr(part));
  }
}

TEST_F(TradeRunTest, LeavesOutWhatIsRefusedAndSaysWhy) {
  World world(folder_.path());
  world.refused_fit = few()[0].fit_key();
  world.refused_look = few()[3].key();
  for (int round = 0; round < 2; ++round) {
    const auto trade = run(world, options());
    ASSERT_TRUE(trade) << trade.error().what;
    EXPECT_EQ(trade->points.size(), 3U);
    ASSERT_EQ(trade->left_out.size(), 3U);
    EXPECT_EQ(trade->left_out[0].name, few()[0].name());
    EXPECT_EQ(trade->left_out[0].why, "it does not fit");
    EXPECT_EQ(trade->left_out[2].why, "it cannot be drawn");
  }
  EXPECT_EQ(world.fits[world.refused_fit], 1);  // it is known from the first round
  EXPECT_EQ(world.looks[world.refused_look], 1);
}

TEST_F(TradeRunTest, IsRefusedWhereEverythingIsLeftOut) {
  World world(folder_.path());
  world.refused_fit = few()[0].fit_key();
  SilentProgress progress;
  const std::vector<Candidate> one{few()[0]};
  const auto none = run_trade(options(), one, world.tools(), progress);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("it does not fit"));
}

TEST_F(TradeRunTest, TakesAChangeOfLoadBetweenTimingRunsOutOfTheMilliseconds) {
  World world(folder_.path());
  TradeRun how = options();
  how.most_bytes = 1;  // each by itself
  const auto trade = run(world, how);
  ASSERT_TRUE(trade) << trade.error().what;
  EXPECT_EQ(world.timings, 6);
  for (const TradePoint& p : trade->points) {
    EXPECT_NEAR(p.ms_median, trade->plain_ms * p.ratio, 1e-9 * p.ms_median);
    EXPECT_NEAR(p.ms_p95, 2 * p.ms_median, 1e-9 * p.ms_p95);
  }
}

TEST_F(TradeRunTest, AFullDiskIsSaidAndCostsOnlyWhatWasUnderWay) {
  World world(folder_.path());
  const int status = on_full_disk(600, [&] {
    const auto full = run(world, options());
    return !full && full.error().code == Errc::kIo ? 0 : 1;
  });
  ASSERT_EQ(status, 0);
  EXPECT_TRUE(run(world, options()));
}

}  // namespace
}  // namespace veneer::quality
