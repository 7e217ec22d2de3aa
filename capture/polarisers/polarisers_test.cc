// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/polarisers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace veneer::capture {
namespace {

using testing::HasSubstr;

class RecordingHands final : public Hands {
 public:
  Status please(const HandRequest& request) override {
    requests.push_back(request);
    if (refuses) return fail(Errc::kCancelled, "no more");
    return {};
  }
  void say(std::string_view) override {}
  bool refuses = false;
  std::vector<HandRequest> requests;
};

Result<std::unique_ptr<Polariser>> open(const std::string& text, Hands& hands) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "rig.toml"));
  VENEER_ASSIGN(auto polariser, open_polariser(toml, hands));
  VENEER_TRY(toml.finish());
  return polariser;
}

TEST(Polarisers, AreSortedByName) {
  EXPECT_TRUE(std::ranges::is_sorted(polariser_drivers(), {}, &PolariserDriver::name));
}

TEST(Polarisers, AHandIsAskedForTheAngle) {
  RecordingHands hands;
  for (const char* text : {"", "driver = \"hand\""}) {
    const auto polariser = open(text, hands);
    ASSERT_TRUE(polariser) << polariser.error().what;
    ASSERT_TRUE((*polariser)->turn_to(1.5707963267948966));
    EXPECT_EQ(hands.requests.back().task, HandRequest::Task::kTurnAnalyser);
    EXPECT_EQ(hands.requests.back().angle_rad, 1.5707963267948966);
    EXPECT_THAT(hands.requests.back().text, HasSubstr("90 degrees"));
    hands.refuses = true;
    EXPECT_EQ((*polariser)->turn_to(0).error().code, Errc::kCancelled);
    hands.refuses = false;
  }
}

TEST(Polarisers, MistakesInTheTableAreNamed) {
  RecordingHands hands;
  for (const auto& [text, said] : std::vector<std::pair<std::string, std::string>>{
           {"driver = \"stage\"", "elliptec, hand"},
           {"driver = \"elliptec\"", "polariser.port"},
           {"driver = \"elliptec\"\nport = \"/dev/null\"\naddress = \"G\"", "polariser.address"},
           {"driver = \"elliptec\"\nport = \"/dev/null\"\naddress = \"\"", "polariser.address"},
           {"port = \"x\"", "port"}}) {
    const auto polariser = open(text, hands);
    ASSERT_FALSE(polariser) << text;
    EXPECT_EQ(polariser.error().code, Errc::kInvalidOption) << text;
    EXPECT_THAT(polariser.error().what, HasSubstr(said)) << text;
  }
}

}  // namespace
}  // namespace veneer::capture
