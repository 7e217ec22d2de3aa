// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

namespace veneer::projector {
namespace {

Result<std::unique_ptr<Output>> output_of(const std::string& text) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  VENEER_ASSIGN(std::unique_ptr<Output> output, open_output(toml));
  VENEER_TRY(toml.finish());
  return output;
}

TEST(Outputs, AreSortedAndSayWhatTheyAre) {
  EXPECT_TRUE(std::ranges::is_sorted(output_drivers(), {}, &OutputDriver::name));
  for (const OutputDriver& driver : output_drivers())
    EXPECT_FALSE(driver.summary.empty()) << driver.name;
}

TEST(Outputs, AnUnknownNameIsRefusedWithTheKnownOnes) {
  for (const char* text : {"", "driver = \"\"", "driver = \"laser\""}) {
    const auto output = output_of(text);
    ASSERT_FALSE(output) << text;
    EXPECT_EQ(output.error().code, Errc::kInvalidOption);
    for (const OutputDriver& driver : output_drivers()) {
      EXPECT_NE(output.error().what.find(driver.name), std::string::npos) << output.error().what;
    }
  }
}

TEST(NullOutput, WantsNothingAndTakesEverything) {
  auto output = output_of("driver = \"null\"");
  ASSERT_TRUE(output) << output.error().what;
  for (const std::uint64_t number : {0U, 1U, 60U}) {
    EXPECT_FALSE((*output)->wants_pixels(number));
    EXPECT_FALSE((*output)->wants_target(number));
  }
  EXPECT_FALSE((*output)->description().empty());
  EXPECT_TRUE((*output)->present({}));
  EXPECT_TRUE((*output)->finish());
  EXPECT_EQ((*output)->waits(), 0U);
  EXPECT_FALSE(output_of("driver = \"null\"\nfolder = \"x\""));  // a key it does not know
}

}  // namespace
}  // namespace veneer::projector
