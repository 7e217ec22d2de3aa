// SPDX-License-Identifier: Apache-2.0
// The shipped scenarios against the real veneerd, and what they say when a behaviour is taken away.
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "base/exit_code.h"
#include "base/testing/browser.h"
#include "tests/program.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Material and profile are made once for all.
const fs::path& folder() {
  static const TemporaryFolder folder;
  return folder.path();
}

fs::path scenario(const std::string& name) {
  return fs::path(VENEER_ETC) / "scenarios" / (name + ".toml");
}

Outcome harness(const fs::path& path, const std::string& more = "") {
  return run(fmt::format(
      "veneer harness --json run {} --out {} {}", path.string(), folder().string(), more));
}

std::vector<std::string> shipped() {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(fs::path(VENEER_ETC) / "scenarios")) {
    const auto text = read_text(entry.path());
    if (text && text->find("[[expect]]") != std::string::npos) {
      names.push_back(entry.path().stem().string());
    }
  }
  std::ranges::sort(names);
  return names;
}

class ShippedScenario : public testing::TestWithParam<std::string> {};

TEST_P(ShippedScenario, Passes) {
  const Outcome outcome = harness(scenario(GetParam()));
  EXPECT_EQ(outcome.exit_code, kExitDone) << outcome.out << outcome.err;
  const auto page = read_text(folder() / GetParam() / "index.html");
  ASSERT_TRUE(page) << page.error().what;
  EXPECT_EQ(page->find("{{DATA}}"), std::string::npos);
  EXPECT_EQ(page->find("http"), std::string::npos) << "needs the network";
}

INSTANTIATE_TEST_SUITE_P(All, ShippedScenario, testing::ValuesIn(shipped()), [](const auto& each) {
  std::string name = each.param;
  std::ranges::replace(name, '-', '_');
  return name;
});

TEST(HarnessPage, DrawsACurveOfEachQuantityWithoutAFault) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const std::string name = shipped().front();
  const Outcome outcome = harness(scenario(name));
  ASSERT_EQ(outcome.exit_code, kExitDone) << outcome.out << outcome.err;
  const auto page = read_text(folder() / name / "index.html");
  ASSERT_TRUE(page) << page.error().what;
  const auto seen =
      seen_in_browser(*page,
                      "return { curves: document.querySelectorAll('#curves polyline').length,"
                      " titles: document.querySelectorAll('#curves h2').length };");
  ASSERT_TRUE(seen) << seen.error().what;
  const json found = json::parse(*seen);
  EXPECT_EQ(found.at("faults"), json::array());
  EXPECT_GE(found.at("found").at("curves"), 3);
  EXPECT_EQ(found.at("found").at("curves"), found.at("found").at("titles"));
}

TEST(Scenarios, AreTenOrMore) { EXPECT_GE(shipped().size(), 10U); }

/// A scenario whose behaviour a setting takes away, and the quantity that must show it.
struct Broken {
  const char* scenario;
  const char* settings;
  const char* quantity;
};

class BrokenBehaviour : public testing::TestWithParam<Broken> {};

TEST_P(BrokenBehaviour, IsSeen) {
  const Outcome outcome = harness(scenario(GetParam().scenario), GetParam().settings);
  ASSERT_EQ(outcome.exit_code, kExitGateMissed) << outcome.out << outcome.err;
  const json verdicts = json::parse(outcome.out).at(0).at("expectations");
  EXPECT_TRUE(std::ranges::any_of(verdicts, [](const json& verdict) {
    return verdict.at("quantity") == GetParam().quantity && verdict.at("met") == false;
  })) << outcome.out;
}

constexpr const char* kNoPrediction = "--set prediction.horizon_s=0 --set prediction.decay_s=1e-6";
INSTANTIATE_TEST_SUITE_P(
    All,
    BrokenBehaviour,
    testing::Values(Broken{"steady-walk", kNoPrediction, "position_error_mm"},
                    Broken{"fast-head-turn", kNoPrediction, "position_error_mm"},
                    Broken{"slow-to-30hz", kNoPrediction, "position_error_mm"},
                    Broken{"dropouts", "--set presence.lost_s=1000", "specular_weight"},
                    Broken{"unplug-and-replug", "--set presence.lost_s=1000", "specular_weight"},
                    Broken{"hand-over", "--scene " VENEER_ETC "/scenarios/scene.toml", "observer"},
                    Broken{"teleport", "--set validation.speed_m_s=1e9", "position_error_mm"}),
    [](const auto& each) {
      std::string name = each.param.scenario;
      std::ranges::replace(name, '-', '_');
      return name;
    });

/// The steady walk with something changed; the name of the file.
fs::path changed(const std::string& from, const std::string& to) {
  std::string text = read_text(scenario("steady-walk")).value();
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  const fs::path path = folder() / "changed.toml";
  EXPECT_TRUE(write_text(path, text));
  EXPECT_TRUE(write_text(folder() / "scene.toml",
                         read_text(fs::path(VENEER_ETC) / "scenarios" / "scene.toml").value()));
  return path;
}

TEST(HarnessErrors, NameWhatThereIs) {
  EXPECT_TRUE(fails(harness(changed("\"counter.lost\"", "\"counter.lots\"")),
                    kExitUsage,
                    "there are bad_frames"));
  EXPECT_TRUE(fails(
      harness(changed("\"presence.tracked\"", "\"presense\"")), kExitUsage, "position_error_mm"));
  EXPECT_TRUE(fails(harness(changed("\"p95\"", "\"p96\"")), kExitUsage, "\"p96\" is none of"));
  EXPECT_TRUE(fails(harness(changed("at_most = 1.0\n", "")), kExitUsage, "no bound"));
  EXPECT_TRUE(fails(harness(changed("about = ", "abuot = ")), kExitUsage, "about"));
  EXPECT_TRUE(fails(harness(changed("body = 1", "body = 99")), kExitUsage, "body 1 has no path"));
  EXPECT_TRUE(fails(harness(changed("scene.toml", "secne.toml")), kExitFailed, "secne.toml"));
  EXPECT_TRUE(fails(harness("missing.toml"), kExitUsage, "missing.toml"));
}

TEST(HarnessErrors, WhatWasNotMeasuredIsNotMet) {
  const Outcome outcome = harness(changed("from_s = 0.4", "from_s = 1e6"));
  EXPECT_EQ(outcome.exit_code, kExitGateMissed) << outcome.out;
}

}  // namespace
}  // namespace veneer
