// SPDX-License-Identifier: Apache-2.0
#include "daemon/faults.h"

#include <gtest/gtest.h>

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::State;

TEST(Faults, StartUntilTheFirstFrame) {
  Faults faults;
  EXPECT_EQ(faults.state(), State::kStarting);
  faults.begin(FaultKind::kTracker, Time{1s}, "silent");
  EXPECT_EQ(faults.state(), State::kStarting) << "there is no picture that could be worse";
  faults.first_frame();
  EXPECT_EQ(faults.state(), State::kDegraded);
  faults.end(FaultKind::kTracker, Time{2s});
  EXPECT_EQ(faults.state(), State::kRunning);
}

TEST(Faults, AStateIsThatOfItsWorstFaultWhateverTheOrder) {
  for (std::size_t first = 0; first < service::kFaultKindCount; ++first) {
    for (std::size_t second = 0; second < service::kFaultKindCount; ++second) {
      const auto a = static_cast<FaultKind>(first);
      const auto b = static_cast<FaultKind>(second);
      Faults faults;
      faults.first_frame();
      faults.begin(a, Time{1s}, "a");
      faults.begin(b, Time{2s}, "b");
      EXPECT_EQ(faults.state(), std::max(effect_of(a), effect_of(b)));
      faults.end(b, Time{3s});
      EXPECT_EQ(faults.state(), a == b ? State::kRunning : effect_of(a));
    }
  }
}

TEST(Faults, DarknessThatWasAskedForIsBlankAndNoFault) {
  Faults faults;
  faults.first_frame();
  faults.ask_for_dark(true);
  EXPECT_EQ(faults.state(), State::kBlank);
  EXPECT_TRUE(faults.list().empty());
  faults.begin(FaultKind::kOutput, Time{1s}, "unplugged");
  EXPECT_EQ(faults.state(), State::kFault);
  faults.ask_for_dark(false);
  faults.end(FaultKind::kOutput, Time{2s});
  EXPECT_EQ(faults.state(), State::kRunning);
}

TEST(Faults, NothingComesAfterStopping) {
  Faults faults;
  faults.first_frame();
  faults.stopping();
  faults.begin(FaultKind::kGpu, Time{1s}, "reset");
  faults.ask_for_dark(true);
  EXPECT_EQ(faults.state(), State::kStopping);
}

TEST(Faults, OneThatGoesOnKeepsItsBeginningAndTakesTheText) {
  Faults faults;
  EXPECT_TRUE(faults.begin(FaultKind::kDisk, Time{1s}, "full"));
  EXPECT_FALSE(faults.begin(FaultKind::kDisk, Time{2s}, "read-only"));
  const auto list = faults.list();
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0].since, Time{1s});
  EXPECT_EQ(list[0].text, "read-only");
  EXPECT_FALSE(faults.end(FaultKind::kLate, Time{3s})) << "that was never there";
  EXPECT_EQ(faults.recovered(), 0U);
  EXPECT_TRUE(faults.end(FaultKind::kDisk, Time{3s}));
  EXPECT_FALSE(faults.end(FaultKind::kDisk, Time{3s}));
  EXPECT_EQ(faults.recovered(), 1U);
}

TEST(Faults, AreListedOldestFirst) {
  Faults faults;
  faults.begin(FaultKind::kMemory, Time{1s}, "m");
  faults.begin(FaultKind::kTracker, Time{2s}, "t");
  faults.begin(FaultKind::kDisk, Time{3s}, "d");
  const auto list = faults.list();
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[0].kind, FaultKind::kMemory);
  EXPECT_EQ(list[2].kind, FaultKind::kDisk);
}

TEST(Faults, EachChangeIsToldOnce) {
  Faults faults;
  faults.first_frame();
  (void)faults.take_changes();
  for (int i = 0; i < 5; ++i) faults.begin(FaultKind::kOutput, Time{1s}, "unplugged");
  const auto worse = faults.take_changes();
  ASSERT_EQ(worse.size(), 2U) << "the fault, and the state";
  EXPECT_TRUE(worse[0].fault && worse[0].begun);
  EXPECT_NE(worse[0].text.find("unplugged"), std::string::npos);
  EXPECT_FALSE(worse[1].fault);
  EXPECT_EQ(worse[1].state, State::kFault);
  EXPECT_EQ(worse[1].text, "after running");
  EXPECT_TRUE(faults.take_changes().empty());
  faults.end(FaultKind::kOutput, Time{3500ms});
  const auto better = faults.take_changes();
  ASSERT_EQ(better.size(), 2U);
  EXPECT_TRUE(better[0].fault && !better[0].begun);
  EXPECT_NE(better[0].text.find("2.5 s"), std::string::npos) << better[0].text;
}

TEST(Faults, RememberABoundedNumberOfChangesWhenNobodyAsks) {
  Faults faults;
  for (int i = 0; i < 1000; ++i) {
    faults.begin(FaultKind::kDisk, Time{}, "x");
    faults.end(FaultKind::kDisk, Time{});
  }
  EXPECT_EQ(faults.take_changes().size(), Faults::kRememberedChanges);
  EXPECT_EQ(faults.recovered(), 1000U);
}

}  // namespace
}  // namespace veneer::daemon
