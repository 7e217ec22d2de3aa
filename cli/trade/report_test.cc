// SPDX-License-Identifier: Apache-2.0
#include "cli/trade/report.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>
#include <sstream>

#include "base/files.h"
#include "base/image_files.h"
#include "base/testing/browser.h"
#include "base/testing/temporary_folder.h"
#include "quality/ladder.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kWidth = 16;
constexpr int kHeight = 12;

quality::Trade example() {
  quality::Trade trade;
  trade.renderer = "a </script> renderer";  // must not end the page's data
  trade.clock = "GL timer query";
  trade.machine = "a machine";
  trade.date = "2024-05-06 07:08 UTC";
  trade.plain_ms = 10;
  const auto add = [&trade](const char* model, int lobes, double scale, double ratio, double de00) {
    quality::TradePoint p;
    p.candidate.model = model;
    p.candidate.fit.lobes = lobes;
    p.candidate.drawing.scale = scale;
    p.ratio = ratio;
    p.ms_median = 10 * ratio;
    p.ms_p95 = 11 * ratio;
    p.gpu_bytes = 1e6 * de00;
    p.de00_mean = de00 / 2;
    p.received_de00_mean = de00;
    p.received_de00_p95 = 2 * de00;
    trade.points.push_back(p);
  };
  add("lafortune", 2, 1, 4, 1);
  add("phong", 1, 1, 1.5, 5);
  add("lafortune", 1, 1, 3, 2);
  add("lpca", 1, 1, 9, 0.4);
  add("reflectance-field", 1, 1, 7, 3);  // beaten
  add("phong", 1, 0.5, 0.5, 6);
  trade.points.back().set_epsilon = std::numeric_limits<double>::quiet_NaN();
  trade.left_out.push_back({"lpca 99", "too many"});
  return trade;
}

TradeAbout about() {
  return {.set = "cloth.btfset",
          .scene = "scene.toml",
          .profile = "profile",
          .grid = "coarse",
          .views = 4,
          .frames = 20,
          .white_nits = 100,
          .chosen = {}};
}

/// A report as a run leaves it.
void write_example(const fs::path& folder, const quality::Trade& trade, const TradeAbout& what) {
  int shade = 0;
  for (const quality::TradePoint& p : trade.points) {
    std::vector<ExrChannel> channels;
    for (const char* name : {"X", "Y", "Z", "dE00"})
      channels.push_back({name, Image<float>(kWidth, kHeight, static_cast<float>(10 + ++shade))});
    ASSERT_TRUE(write_exr(quality::crop_path(folder, p.candidate), channels));
  }
  const Image<Rgb32f> reference(kWidth, kHeight, Rgb32f(50, 50, 50));
  const Status written = write_trade_report(trade, what, reference, folder);
  ASSERT_TRUE(written) << written.error().what;
}

TEST(TradeJson, HoldsWhatWasMeasuredAndMarksTheFront) {
  const quality::Trade trade = example();
  const json report = json::parse(trade_json(trade, about()).dump());
  ASSERT_EQ(report["candidates"].size(), trade.points.size());
  const std::vector<bool> on_front{true, true, true, true, false, true};
  for (std::size_t i = 0; i < trade.points.size(); ++i) {
    const json& c = report["candidates"][i];
    EXPECT_EQ(c["model"], trade.points[i].candidate.model);
    EXPECT_EQ(c["ms_median"], trade.points[i].ms_median);
    EXPECT_EQ(c["ratio"], trade.points[i].ratio);
    EXPECT_EQ(c["gpu_bytes"], trade.points[i].gpu_bytes);
    EXPECT_EQ(c["de00_mean"], trade.points[i].de00_mean);
    EXPECT_EQ(c["pareto"], on_front[i]) << i;
    EXPECT_EQ(c["options"]["scale"], trade.points[i].candidate.drawing.scale);
    EXPECT_TRUE(c.contains("de00_p95"));
  }
  EXPECT_TRUE(report["candidates"][5]["epsilon_avg"].is_null());  // no number is no zero
  EXPECT_EQ(report["left_out"][0]["why"], "too many");
}

TEST(TradeJson, KeepsACacheThatServesNothingOffTheFronts) {
  quality::Trade trade = example();
  quality::TradePoint& best = trade.points[3];  // an lpca
  best.candidate.drawing.cache.spacing = 16;
  for (const double served : {0.5, 0.0}) {
    best.cache_served = served;
    const json entry = json::parse(trade_json(trade, about()).dump())["candidates"][3];
    EXPECT_EQ(entry["cache_served"], served);
    EXPECT_EQ(entry["idle_cache"], served == 0.0);
    EXPECT_EQ(entry["pareto"], served > 0.0);
    EXPECT_EQ(entry["pareto_bytes"], served > 0.0);
  }
}

TEST(TradeText, SaysWhichSharesAnIdleCacheServes) {
  quality::Trade trade = example();
  EXPECT_EQ(idle_caches_in_words(trade), "");
  const auto cached = [&trade](std::size_t i, double served) {
    trade.points[i].candidate.drawing.cache.spacing = 16;
    trade.points[i].cache_served = served;
  };
  cached(3, 0.01);  // enough
  EXPECT_EQ(idle_caches_in_words(trade), "");
  cached(2, 0.002);
  EXPECT_EQ(idle_caches_in_words(trade),
            "1 with the angular cache is not among them: in this scene 0.2 % of the surface is "
            "drawn from it, and under 1 % it only costs time");
  cached(0, 0.0);
  cached(4, 0.0099);
  EXPECT_EQ(idle_caches_in_words(trade),
            "3 with the angular cache are not among them: in this scene 0 to 0.99 % of the surface "
            "is drawn from it, and under 1 % it only costs time");
}

TEST(TradeCsv, HasAFieldForEachColumnInEachLine) {
  std::istringstream lines(trade_csv(example()));
  std::string line;
  std::getline(lines, line);
  const auto columns = std::ranges::count(line, ',');
  int count = 0;
  while (std::getline(lines, line)) {
    ++count;
    const std::size_t end_of_name = line.find('"', 1);
    EXPECT_EQ(std::count(line.begin() + static_cast<std::ptrdiff_t>(end_of_name), line.end(), ','),
              columns)
        << line;
  }
  EXPECT_EQ(count, 6);
}

TEST(TradeReport, IsOneFileThatNeedsNoOther) {
  const TemporaryFolder folder;
  write_example(folder.path(), example(), about());
  const std::string page = read_text(folder.path() / "index.html").value();
  EXPECT_EQ(page.find("{{DATA}}"), std::string::npos);
  for (const char* outside : {"src=\"", "href=", "@import", "url(", "fetch(", "XMLHttp"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  const auto ladder = quality::Ladder::load(folder.path() / "ladder.toml");
  ASSERT_TRUE(ladder) << ladder.error().what;
  EXPECT_EQ(ladder->rungs.front().name, example().points[3].candidate.name());
  EXPECT_FALSE(fs::exists(folder.path() / "crops" / "picture.png"));
}

TEST(TradeReport, SaysWhichCropIsDamaged) {
  const TemporaryFolder folder;
  const quality::Trade trade = example();
  write_example(folder.path(), trade, about());
  const fs::path crop = quality::crop_path(folder.path(), trade.points[2].candidate);
  ASSERT_TRUE(write_exr(crop, {{"X", Image<float>(2, 2)}}));
  const Status refused =
      write_trade_report(trade, about(), Image<Rgb32f>(kWidth, kHeight), folder.path());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find(crop.filename().string()), std::string::npos);
}

/// What a hand does to the page, in a browser: clicks, and what is there afterwards.
constexpr char kHand[] = R"(
const probe = {};
const names = () => [...document.querySelectorAll('tbody tr')].map(r => r.dataset.key);
const press = s => document.querySelector(s).dispatchEvent(new MouseEvent('click', { bubbles: true }));
probe.dots = document.querySelectorAll('#plot circle').length;
probe.front = document.querySelectorAll('#plot circle.on-front').length;
probe.start = document.querySelector('#detail h2').textContent;
press('button[data-column=ms_median]');
probe.cheapest_first = names();
press('button[data-column=ms_median]');
probe.dearest_first = names();
press('button[data-column=name]');
probe.by_name = names();
probe.sorted_by = [...document.querySelectorAll('th')].map(t => t.getAttribute('aria-sort'));
press('#plot circle[data-key=lpca-4]');
probe.clicked = document.querySelector('#detail h2').textContent;
for (const id of ['drawn', 'reference', 'difference']) probe[id] = document.getElementById('crop-' + id).src;
document.querySelector('#plot circle.chosen').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }));
probe.beside = document.querySelector('#detail h2').textContent;
press('tbody tr[data-key=phong-scale0\\.5] button');
probe.from_table = document.querySelector('#detail h2').textContent;
const cost = document.getElementById('cost');
cost.value = 'gpu_bytes';
cost.dispatchEvent(new Event('change'));
probe.dots_by_bytes = document.querySelectorAll('#plot circle').length;
probe.front_by_bytes = document.querySelectorAll('#plot circle.on-front').length;
press('.chip[data-model=lafortune]');
probe.dots_filtered = document.querySelectorAll('#plot circle').length;
probe.rows_filtered = names().length;
probe.words = document.getElementById('words').textContent;
probe.served = [...document.querySelectorAll('tbody tr')].map(r => r.lastElementChild.textContent).filter(Boolean);
probe.where = document.getElementById('where').textContent;
probe.widths = await Promise.all([...document.images].map(i => i.decode().then(() => i.naturalWidth)));
return probe;
)";

TEST(TradePage, DrawsSortsAndShowsCropsInABrowser) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const TemporaryFolder folder;
  quality::Trade trade = example();
  trade.points[4].candidate.drawing.cache.spacing =
      16;  // of a model that has none: not in its name
  trade.points[4].cache_served = 0.002;
  write_example(folder.path(), trade, about());
  const auto seen = seen_in_browser(read_text(folder.path() / "index.html").value(), kHand);
  ASSERT_TRUE(seen) << seen.error().what;
  const json all = json::parse(*seen);
  EXPECT_EQ(all["faults"], json::array());
  const json& probe = all["found"];

  EXPECT_EQ(probe["dots"], 6);
  EXPECT_EQ(probe["front"], 5);
  EXPECT_EQ(probe["start"], "lpca 4");  // the nearest on the front
  const json cheapest_first{"phong-scale0.5",
                            "phong",
                            "lafortune-lobes1",
                            "lafortune-lobes2",
                            "reflectance-field-lobes1",
                            "lpca-4"};
  EXPECT_EQ(probe["cheapest_first"], cheapest_first);
  json dearest_first = cheapest_first;
  std::reverse(dearest_first.begin(), dearest_first.end());
  EXPECT_EQ(probe["dearest_first"], dearest_first);
  EXPECT_EQ(probe["by_name"],
            json({"lafortune-lobes1",
                  "lafortune-lobes2",
                  "lpca-4",
                  "phong",
                  "phong-scale0.5",
                  "reflectance-field-lobes1"}));
  EXPECT_EQ(probe["sorted_by"][0], "ascending");
  EXPECT_EQ(probe["sorted_by"][1], "none");

  EXPECT_EQ(probe["clicked"], "lpca 4");
  EXPECT_EQ(probe["beside"], "reflectance-field 1 lobe");  // the next cheaper
  EXPECT_EQ(probe["from_table"], "phong, scale 0.5");
  for (const char* id : {"drawn", "reference", "difference"})
    EXPECT_TRUE(probe[id].get<std::string>().starts_with("data:image/png;base64,")) << id;
  EXPECT_NE(probe["drawn"], probe["difference"]);
  EXPECT_EQ(probe["widths"], json({kWidth, kWidth, kWidth, 160}));

  EXPECT_EQ(probe["dots_by_bytes"], 6);
  EXPECT_EQ(probe["front_by_bytes"], 1);  // the nearest is the smallest here
  EXPECT_EQ(probe["dots_filtered"], 4);
  EXPECT_EQ(probe["rows_filtered"], 4);
  EXPECT_EQ(probe["served"], json({"0.2 %"}));  // not "0 %"
  const std::string words = probe["words"];
  EXPECT_NE(words.find("lpca 4 at scale 1 is 9.0 x plain and 0.40 dE00"), std::string::npos)
      << words;
  const std::string where = probe["where"];
  for (const char* part : {"a </script> renderer", "GL timer query", "a machine", "2024-05-06"})
    EXPECT_NE(where.find(part), std::string::npos) << where;
}

}  // namespace
}  // namespace veneer::cli
