// SPDX-License-Identifier: Apache-2.0
#include "daemon/housekeeper.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <string>

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;

class HousekeeperTest : public ::testing::Test {
 protected:
  Housekeeper keeper(ClockKind kind) { return {clock_, kind, faults_, board_, {}}; }
  /// Frames every 20 ms; of any hundred in a row so many are late.
  void frames(Housekeeper& keeper, Duration time, int late_percent) {
    for (const Time end = clock_.now() + time; clock_.now() < end;) {
      clock_.sleep_until(clock_.now() + 20ms);
      FrameFigures figures;
      figures.done = clock_.now();
      figures.late = (number_++ * late_percent) % 100 < late_percent;
      board_.post(figures);
      keeper.look();
    }
  }

  VirtualClock clock_{Time{100s}};
  Faults faults_;
  FigureBoard board_;
  int number_ = 0;
};

TEST_F(HousekeeperTest, MostFramesLateIsAFaultUntilFewAre) {
  Housekeeper keeper = this->keeper(ClockKind::kMonotonic);
  frames(keeper, 4s, 40);
  EXPECT_FALSE(faults_.has(FaultKind::kLate)) << "fewer than half";
  frames(keeper, 4s, 60);
  ASSERT_TRUE(faults_.has(FaultKind::kLate));
  EXPECT_NE(faults_.list().at(0).text.find("[quality]"), std::string::npos) << "what to do";
  frames(keeper, 4s, 40);
  EXPECT_TRUE(faults_.has(FaultKind::kLate)) << "no coming and going on the border";
  frames(keeper, service::recovery_time_of(FaultKind::kLate), 10);
  EXPECT_FALSE(faults_.has(FaultKind::kLate));
}

TEST_F(HousekeeperTest, InVirtualTimeNoFrameIsLate) {
  Housekeeper keeper = this->keeper(ClockKind::kVirtual);
  frames(keeper, 4s, 100);
  EXPECT_FALSE(faults_.has(FaultKind::kLate));
}

TEST_F(HousekeeperTest, TellsOnceThatTheMachineSlept) {
  Housekeeper keeper = this->keeper(ClockKind::kMonotonic);
  ::testing::internal::CaptureStdout();
  keeper.look();
  board_.note_sleep(90min);
  keeper.look();
  keeper.look();
  spdlog::default_logger()->flush();
  const std::string told = ::testing::internal::GetCapturedStdout();
  EXPECT_NE(told.find("slept for 5400.0 s"), std::string::npos) << told;
  EXPECT_EQ(told.find("slept"), told.rfind("slept")) << told;
}

}  // namespace
}  // namespace veneer::daemon
