// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures.h"

#include <gtest/gtest.h>

#include <thread>

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;

FrameFigures frame_at(Time done, double frame_ms) {
  FrameFigures figures;
  figures.done = done;
  figures.frame_ms = frame_ms;
  figures.latency_ms.draw = frame_ms;
  return figures;
}

TEST(FigureBoard, IsZeroBeforeTheFirstFrame) {
  const FigureBoard board;
  const auto figures = board.last_second(Time{5s});
  EXPECT_EQ(figures.frames, 0U);
  EXPECT_EQ(figures.frame_rate_hz, 0);
  EXPECT_EQ(figures.frame_ms_median, 0);
  EXPECT_EQ(board.late_part(Time{5s}, 3s), std::nullopt);
}

TEST(FigureBoard, TellsOfTheLastSecondOnly) {
  FigureBoard board;
  for (int i = 1; i <= 500; ++i) board.post(frame_at(Time{i * 10ms}, i <= 400 ? 1 : 3));
  const auto figures = board.last_second(Time{5s});
  EXPECT_EQ(figures.frames, 500U);
  EXPECT_EQ(figures.frame_rate_hz, 100);
  EXPECT_EQ(figures.frame_ms_median, 3);
  EXPECT_EQ(figures.latency_ms.total(), 3);
  EXPECT_EQ(board.last_second(Time{7s}).frame_rate_hz, 0) << "nothing comes any more";
  EXPECT_EQ(board.last_second(Time{7s}).frames, 500U);
}

TEST(FigureBoard, GpuTimesThatNobodyKnowsDoNotCount) {
  FigureBoard board;
  for (int i = 1; i <= 9; ++i) {
    FrameFigures figures = frame_at(Time{i * 10ms}, 1);
    if (i % 3 == 0) figures.gpu_ms = 0.25;
    board.post(figures);
  }
  EXPECT_EQ(board.last_second(Time{90ms}).gpu_ms_median, 0.25);
}

TEST(FigureBoard, DarkFramesCountButTellNoTimes) {
  FigureBoard board;
  for (int i = 1; i <= 10; ++i) {
    FrameFigures figures = frame_at(Time{i * 10ms}, i <= 5 ? 4 : 0);
    figures.dark = i > 5;
    board.post(figures);
  }
  const auto figures = board.last_second(Time{100ms});
  EXPECT_EQ(figures.frame_rate_hz, 10);
  EXPECT_EQ(figures.frame_ms_median, 4);
}

TEST(FigureBoard, CountsLateFramesAndDroppedOnesAlike) {
  FigureBoard board;
  board.post(frame_at(Time{1ms}, 1));
  EXPECT_EQ(board.late_part(Time{2s}, 3s), std::nullopt) << "frames have only begun";
  for (int i = 0; i < 100; ++i) {
    FrameFigures figures = frame_at(Time{10s + i * 20ms}, 1);
    figures.late = i % 4 == 0;
    figures.missed = i > 0 ? 1 : 0;  // one between any two
    board.post(figures);
  }
  EXPECT_NEAR(board.late_part(Time{12s}, 3s).value(), (25 + 99) / 199.0, 1e-12);
  // Nobody knows how the frame goes that takes longer than that.
  EXPECT_EQ(board.late_part(Time{15s}, 3s), std::nullopt);
}

TEST(FigureBoard, NoFrameIsLateThatTheDisplayRefused) {
  FigureBoard board;
  std::uint64_t dropped = 0;
  const auto post = [&](int i, bool refused) {
    FrameFigures figures = frame_at(Time{i * 20ms}, 1);
    figures.late = true;
    figures.dark = refused;
    figures.missed = 1;
    figures.dropped = dropped += refused ? 2 : 1;
    board.post(figures);
  };
  for (int i = 1; i <= 200; ++i) post(i, false);
  EXPECT_EQ(board.late_part(Time{4s}, 3s).value(), 1);
  for (int i = 201; i <= 350; ++i) post(i, true);
  EXPECT_EQ(board.late_part(Time{7s}, 3s).value(), 0);
  EXPECT_EQ(board.last_second(Time{7s}).dropped, 500U);
}

TEST(FigureBoard, WhatTheDisplayRefusedDidNotGoOut) {
  FigureBoard board;
  for (int i = 1; i <= 100; ++i) {
    FrameFigures figures = frame_at(Time{i * 10ms}, 1);
    figures.out = i % 4 == 0;
    figures.dark = !figures.out;
    board.post(figures);
  }
  EXPECT_EQ(board.turns(), 100U);
  EXPECT_EQ(board.frames(), 25U);
  EXPECT_EQ(board.last_second(Time{1s}).frame_rate_hz, 25);
}

TEST(FigureBoard, AnotherThreadNeverSeesHalfAFrame) {
  FigureBoard board;
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (int i = 1; i <= 200000; ++i) {
      FrameFigures figures = frame_at(Time{Duration{i * 1000}}, i);
      figures.latency_ms = {1.0 * i, 1.0 * i, 1.0 * i, 1.0 * i, 1.0 * i, 1.0 * i, 1.0 * i, 1.0 * i};
      figures.gpu_ms = i;
      board.post(figures);
    }
    stop = true;
  });
  while (!stop) {
    const auto figures = board.last_second(Time{200ms});
    // Medians of one set of frames: of consistent ones each column has the same.
    EXPECT_EQ(figures.latency_ms.total(), 8 * figures.frame_ms_median);
    EXPECT_EQ(figures.gpu_ms_median, figures.frame_ms_median);
  }
  writer.join();
}

}  // namespace
}  // namespace veneer::daemon
