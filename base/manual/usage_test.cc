// SPDX-License-Identifier: Apache-2.0
#include "base/manual/usage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/manual/internal_test_app.h"

namespace veneer::manual {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const Option& find(const Usage& usage, const std::string& name) {
  const auto found = std::ranges::find_if(usage.options, [&name](const Option& option) {
    return option.value == name || std::ranges::find(option.names, name) != option.names.end();
  });
  EXPECT_NE(found, usage.options.end()) << name;
  return found == usage.options.end() ? usage.options.front() : *found;
}

TEST(Usage, TellsWhatTheParserKnows) {
  const TestApp test;
  const Usage usage = usage_of(test.app, "fence");
  EXPECT_EQ(usage.invocation, "fence");
  EXPECT_EQ(usage.summary, "Paint a fence");
  ASSERT_EQ(usage.options.size(), 5U) << "help, dry, colour, coats, boards; the secret is kept";

  const Option& colour = find(usage, "--colour");
  EXPECT_THAT(colour.names, ElementsAre("-c", "--colour"));
  EXPECT_EQ(colour.value, "TEXT");
  EXPECT_THAT(colour.choices, ElementsAre("green", "red-ish"));
  EXPECT_EQ(colour.default_value, "green");
  EXPECT_FALSE(colour.required);

  const Option& coats = find(usage, "--coats");
  EXPECT_EQ(coats.value, "INT");
  EXPECT_THAT(coats.choices, IsEmpty());
  EXPECT_EQ(coats.limit, "INT in [1 - 9]");
  EXPECT_THAT(coats.excludes, ElementsAre("--colour"));

  EXPECT_EQ(find(usage, "--dry").value, "") << "a flag takes no value";
  const Option& boards = find(usage, "BOARDS");
  EXPECT_THAT(boards.names, IsEmpty());
  EXPECT_TRUE(boards.required);
  EXPECT_TRUE(boards.repeated);
}

TEST(Usage, NamesCommandsAsTheyAreTyped) {
  const TestApp test;
  const Usage usage = usage_of(test.app, "fence");
  ASSERT_EQ(usage.commands.size(), 1U);
  EXPECT_EQ(usage.commands[0].invocation, "fence wash");
  EXPECT_EQ(usage.commands[0].summary, "Clean it first");
  EXPECT_TRUE(find(usage.commands[0], "--with").required);
}

}  // namespace
}  // namespace veneer::manual
