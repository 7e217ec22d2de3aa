// SPDX-License-Identifier: Apache-2.0
#include "cli/service/status_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <limits>

#include "base/exit_code.h"

namespace veneer::cli {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::ServiceStatus;
using service::State;
using testing::HasSubstr;

constexpr Time kNow{std::chrono::hours(100)};

ServiceStatus troubled() {
  ServiceStatus status;
  status.state = State::kDegraded;
  status.faults = {{FaultKind::kTracker, kNow - 90s, "is it plugged in?"},
                   {FaultKind::kProjectorState, kNow - 49h, "the lamp was changed"}};
  status.material = "leather";
  status.frame_rate_hz = 59.94;
  status.latency_ms.tracker = 4;
  status.latency_ms.display = 8.5;
  return status;
}

TEST(AgeText, IsCutToWholeUnits) {
  EXPECT_EQ(age_text(-5s), "0 s");
  EXPECT_EQ(age_text(Duration::min()), "0 s");
  EXPECT_EQ(age_text(999ms), "0 s");
  EXPECT_EQ(age_text(59s), "59 s");
  EXPECT_EQ(age_text(60s), "1 min");
  EXPECT_EQ(age_text(60min - 1ns), "59 min");
  EXPECT_EQ(age_text(60min), "1 h");
  EXPECT_EQ(age_text(24h - 1ns), "23 h");
  EXPECT_EQ(age_text(24h), "1 d");
  EXPECT_EQ(age_text(Duration::max()), "106751 d");
}

TEST(StatusTable, NamesEveryFaultWithItsAgeAndEveryStage) {
  const std::string text = table_of(troubled(), kNow);
  EXPECT_THAT(text, testing::StartsWith("state      degraded\n"));
  EXPECT_THAT(text, HasSubstr("\nfault      tracker for 1 min: is it plugged in?\n"));
  EXPECT_THAT(text, HasSubstr("\nfault      projector-state for 2 d: the lamp was changed\n"));
  EXPECT_THAT(text, HasSubstr("\nmaterial   leather\n"));
  EXPECT_THAT(text, testing::Not(HasSubstr("projector  ")))
      << "nothing is said of what is not there";
  for (const service::LatencyStage& stage : service::kLatencyStages)
    EXPECT_THAT(text, HasSubstr(std::string(stage.name)));
  EXPECT_THAT(text, testing::EndsWith("12.50"));
}

TEST(StatusTable, AlignsStagesWithTheirFiguresHoweverWide) {
  for (const double value : {0.0, 12.5, 123456.0, std::numeric_limits<double>::quiet_NaN()}) {
    ServiceStatus status;
    for (const service::LatencyStage& stage : service::kLatencyStages)
      status.latency_ms.*stage.milliseconds = value;
    const std::string text = table_of(status, kNow);
    const std::size_t last = text.rfind('\n');
    const std::size_t first = text.rfind('\n', last - 1);
    const std::string names = text.substr(first + 1, last - first - 1);
    const std::string values = text.substr(last + 1);
    std::size_t at = 0;
    for (const service::LatencyStage& stage : service::kLatencyStages) {
      at = names.find(std::string(stage.name) + " ", at) + stage.name.size();
      const std::string figure = fmt::format("{:.2f}", value);
      EXPECT_EQ(values.substr(at - figure.size(), figure.size()), figure) << text;
    }
  }
}

TEST(StatusLine, IsOne) {
  const std::string text = line_of(troubled(), kNow);
  EXPECT_EQ(text,
            "degraded  59.9 frames a second  12.50 ms from pose to light  tracker for 1 min  "
            "projector-state for 2 d");
}

TEST(StatusJson, KeepsWhatTheTableRounds) {
  const nlohmann::ordered_json json = json_of(troubled(), kNow);
  EXPECT_EQ(json.at("state"), "degraded");
  EXPECT_EQ(json.at("faults").at(0).at("kind"), "tracker");
  EXPECT_EQ(json.at("faults").at(0).at("age_s"), 90.0);
  EXPECT_EQ(json.at("frame_rate_hz"), 59.94);
  EXPECT_EQ(json.at("latency_ms").at("display"), 8.5);
  EXPECT_EQ(json.at("latency_ms").at("total"), 12.5);
  EXPECT_EQ(json.at("latency_ms").size(), service::kLatencyStages.size() + 1);
  ServiceStatus status;
  status.frame_rate_hz = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(json_of(status, kNow).at("frame_rate_hz").is_null());
}

TEST(StatusExitCode, TellsAWholePictureFromALesserOne) {
  ServiceStatus status;
  for (const auto& [state, code] : {std::pair{State::kStarting, kExitDone},
                                    std::pair{State::kRunning, kExitDone},
                                    std::pair{State::kStopping, kExitDone},
                                    std::pair{State::kDegraded, kExitGateMissed},
                                    std::pair{State::kBlank, kExitGateMissed},
                                    std::pair{State::kFault, kExitGateMissed}}) {
    status.state = state;
    EXPECT_EQ(exit_code_of(status), code) << name_of(state);
  }
}

}  // namespace
}  // namespace veneer::cli
