// SPDX-License-Identifier: Apache-2.0
#include "daemon/summary.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer::daemon {
namespace {

RunRecord two_frames() {
  RunRecord run;
  for (const std::uint64_t number : {0U, 1U}) {
    FrameRecord frame;
    frame.number = number;
    frame.frame_ms = number == 0 ? 10 : 30;
    frame.pose_age_ms = 20;
    frame.statistics.covered_pixels = 100;
    frame.statistics.out_of_gamut_pixels = number == 0 ? 0 : 50;
    run.frames.push_back(frame);
  }
  run.count = 2;
  run.seconds = 0.5;
  return run;
}

TEST(Summary, WeighsGamutByPixels) {
  const Summary summary = summarise(two_frames());
  EXPECT_EQ(summary.frames, 2U);
  EXPECT_EQ(summary.fps, 4);
  EXPECT_EQ(summary.frame_ms_p50, 20);
  EXPECT_EQ(summary.out_of_gamut, 0.25);
}

TEST(Summary, OfNoFramesIsFinite) {
  const Summary summary = summarise({});
  EXPECT_EQ(summary.fps, 0);
  EXPECT_EQ(summary.out_of_gamut, 0);
  EXPECT_FALSE(text_of(summary).empty());
}

TEST(Summary, IsWrittenAsJsonAndTheFramesAsCsv) {
  const TemporaryFolder folder;
  const RunRecord run = two_frames();
  ASSERT_TRUE(write_summary(summarise(run), folder.path() / "s.json"));
  const auto json = nlohmann::json::parse(read_text(folder.path() / "s.json").value());
  EXPECT_EQ(json.at("frames"), 2);
  EXPECT_EQ(json.at("frame_ms_p50"), 20.0);
  ASSERT_TRUE(write_frame_log(run, folder.path() / "f.csv"));
  const std::string csv = read_text(folder.path() / "f.csv").value();
  EXPECT_EQ(std::ranges::count(csv, '\n'), 3) << csv;
}

}  // namespace
}  // namespace veneer::daemon
