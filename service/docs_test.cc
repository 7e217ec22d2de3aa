// SPDX-License-Identifier: Apache-2.0
// The how-to lists what there is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "base/files.h"
#include "service/bus/command.h"
#include "service/bus/internal_properties.h"
#include "service/metrics/metrics.h"

namespace veneer::service {
namespace {

using testing::HasSubstr;

std::string how_to() {
  return read_text(std::filesystem::path(VENEER_ETC) / "../docs/howto/service.md").value();
}

TEST(HowTo, ListsEveryPropertyMethodErrorAndMetric) {
  const std::string text = how_to();
  for (const Property& each : properties()) EXPECT_THAT(text, HasSubstr("`" + each.name + "`"));
  for (const Command& each : {Command(LoadMaterial{}),
                              Command(SetScene{}),
                              Command(SetLight{}),
                              Command(Blank{}),
                              Command(Reload{}),
                              Command(Snapshot{})})
    EXPECT_THAT(text, HasSubstr(fmt::format("| `{}` |", method_name_of(each))));
  for (int i = 0; i <= static_cast<int>(Errc::kCancelled); ++i) {
    const std::string name = error_name_of(static_cast<Errc>(i));
    EXPECT_THAT(text, HasSubstr("`" + name.substr(name.rfind('.') + 1) + "`"));
  }
  for (std::size_t i = 0; i < kStateCount; ++i)
    EXPECT_THAT(text, HasSubstr(std::string(name_of(static_cast<State>(i)))));
  for (const LatencyStage& stage : kLatencyStages)
    EXPECT_THAT(text, HasSubstr(std::string(stage.name)));
  const std::string metrics = metrics_text(ServiceStatus{});
  const std::regex kType("# TYPE ([a-z_]+) ");
  int count = 0;
  for (std::sregex_iterator it(metrics.begin(), metrics.end(), kType), end; it != end;
       ++it, ++count)
    EXPECT_TRUE(text.find("`" + (*it)[1].str() + "`") != std::string::npos ||
                text.find("`" + (*it)[1].str() + "{") != std::string::npos)
        << (*it)[1];
  EXPECT_GE(count, 12);
}

TEST(HowTo, ListsNoMetricThatThereIsNot) {
  const std::string text = how_to();
  const std::string metrics = metrics_text(ServiceStatus{});
  const std::regex kNamed("`(veneer_[a-z_]+)");
  int count = 0;
  for (std::sregex_iterator it(text.begin(), text.end(), kNamed), end; it != end; ++it, ++count)
    EXPECT_THAT(metrics, HasSubstr("# TYPE " + (*it)[1].str() + " "));
  EXPECT_GE(count, 12);
}

}  // namespace
}  // namespace veneer::service
