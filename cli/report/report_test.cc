// SPDX-License-Identifier: Apache-2.0
#include "cli/report/report.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/files.h"
#include "base/testing/browser.h"
#include "base/testing/temporary_folder.h"

namespace veneer::cli {
namespace {

const nlohmann::json kRun = nlohmann::json::parse(R"({
  "renderer": "r", "frames": 2, "fps": 10, "frame_ms_p50": 1, "frame_ms_p99": 2, "pose_age_ms_p50": 3,
  "pose_age_ms_p99": 4, "dropped_frames": 0, "late_frames": 0, "clock": "virtual", "out_of_gamut": 0.1,
  "out_of_reach": 0.02})");

/// Just good enough for every gate.
RunVerification just_met() {
  RunVerification verification;
  verification.within_gamut = {1000, 1.5, 4.0, 9.0};
  verification.covered = {1100, 2.0, 5.0, 12.0};
  verification.uncompensated = {1000, 4.5, 9.0, 20.0};
  verification.in_gamut_fraction = 0.9;
  return verification;
}

bool met(const RunVerification& verification) {
  return gates_met(report_json(kRun, verification, {}, "cloth", "sphere"));
}

TEST(QualityGates, AreMetAtTheirLimits) { EXPECT_TRUE(met(just_met())); }

TEST(QualityGates, AreMissedOneByOne) {
  const QualityGates gates;
  RunVerification worse = just_met();
  worse.within_gamut.mean = gates.de00_mean + 0.01;
  worse.uncompensated.mean = 100;
  EXPECT_FALSE(met(worse));
  worse = just_met();
  worse.within_gamut.p95 = gates.de00_p95 + 0.01;
  EXPECT_FALSE(met(worse));
  worse = just_met();
  worse.in_gamut_fraction = gates.in_gamut - 0.001;
  EXPECT_FALSE(met(worse));
  worse = just_met();
  worse.uncompensated.mean = gates.uncompensated_ratio * worse.within_gamut.mean - 0.01;
  EXPECT_FALSE(met(worse));
}

TEST(QualityGates, AreNotMetByNothing) {
  RunVerification nothing = just_met();
  nothing.within_gamut = {};
  EXPECT_FALSE(met(nothing));
  nothing = just_met();
  nothing.uncompensated = {};
  EXPECT_FALSE(met(nothing));
}

TEST(Report, HasTheKeysThatItsReadersKnow) {
  const nlohmann::ordered_json report = report_json(kRun, just_met(), {}, "cloth", "sphere");
  for (const char* key : {"frames",
                          "fps",
                          "de00_mean",
                          "de00_p95",
                          "de00_uncompensated_mean",
                          "out_of_gamut",
                          "frame_ms_p50",
                          "frame_ms_p99",
                          "pose_age_ms_p50",
                          "pose_age_ms_p99"}) {
    EXPECT_TRUE(report.contains(key)) << key;
  }
}

TEST(Report, IsOnePageWhoseDataCannotEndTheScript) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "frames.csv",
                         "frame,display_time_ns,frame_ms\n0,0,12.5\n1,1,13.5\n"));
  RunVerification verification = just_met();
  verification.frames.resize(2);
  const nlohmann::ordered_json report =
      report_json(kRun, verification, {}, "</script><b>", "sphere");
  ASSERT_TRUE(write_report(report, verification, folder.path()));
  const std::string page = read_text(folder.path() / "index.html").value();
  EXPECT_EQ(page.find("</script><b>"), std::string::npos);
  EXPECT_NE(page.find("12.5"), std::string::npos);
  EXPECT_EQ(page.find("{{DATA}}"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(read_text(folder.path() / "report.json").value()).at("material"),
            "</script><b>");
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const auto seen = seen_in_browser(
      page, "return [...document.querySelectorAll('polyline')].map(l => l.points.length);");
  ASSERT_TRUE(seen) << seen.error().what;
  const nlohmann::json found = nlohmann::json::parse(*seen);
  EXPECT_EQ(found.at("found"), nlohmann::json({2, 2, 2})) << *seen;
  for (const auto& fault :
       found.at("faults"))  // the pictures, which lie beside it, are refused here
    EXPECT_NE(fault.get<std::string>().find("file"), std::string::npos) << fault;
}

}  // namespace
}  // namespace veneer::cli
