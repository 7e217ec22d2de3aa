// SPDX-License-Identifier: Apache-2.0
#include "service/status.h"

#include <gtest/gtest.h>

#include <set>

namespace veneer::service {
namespace {

TEST(State, IsFoundAgainByItsNameWhichIsItsAlone) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < kStateCount; ++i) {
    const auto state = static_cast<State>(i);
    EXPECT_TRUE(names.insert(name_of(state)).second) << name_of(state);
    EXPECT_EQ(state_named(name_of(state)), state);
  }
  EXPECT_EQ(state_named(""), std::nullopt);
  EXPECT_EQ(state_named("Running"), std::nullopt);
}

TEST(FaultKind, IsFoundAgainByItsNameWhichIsItsAlone) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < kFaultKindCount; ++i) {
    const auto kind = static_cast<FaultKind>(i);
    EXPECT_TRUE(names.insert(name_of(kind)).second) << name_of(kind);
    EXPECT_EQ(fault_kind_named(name_of(kind)), kind);
  }
  EXPECT_EQ(fault_kind_named("tracker "), std::nullopt);
}

TEST(FaultKind, LeavesRunningAndIsOverInTime) {
  for (std::size_t i = 0; i < kFaultKindCount; ++i) {
    const auto kind = static_cast<FaultKind>(i);
    EXPECT_GT(effect_of(kind), State::kRunning) << name_of(kind);
    EXPECT_LT(effect_of(kind), State::kStopping) << name_of(kind);
    EXPECT_GT(recovery_time_of(kind), Duration{0}) << name_of(kind);
    EXPECT_LE(recovery_time_of(kind), std::chrono::seconds(65)) << name_of(kind);
  }
}

TEST(LatencyBudget, IsTheSumOfItsStagesEachOfWhichIsListedOnce) {
  LatencyBudget budget;
  std::set<std::string_view> names;
  double sum = 0;
  double value = 1;
  for (const LatencyStage& stage : kLatencyStages) {
    EXPECT_TRUE(names.insert(stage.name).second) << stage.name;
    budget.*stage.milliseconds = value;
    sum += value;
    value *= 2;  // powers of two: a stage that is missing or listed twice changes the sum
  }
  EXPECT_EQ(budget.total(), sum);
  EXPECT_EQ(sum, 255.0);
}

}  // namespace
}  // namespace veneer::service
