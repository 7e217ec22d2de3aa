// SPDX-License-Identifier: Apache-2.0
#include "base/manual/completion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/manual/internal_test_app.h"
#include "base/testing/temporary_folder.h"

namespace veneer::manual {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;

/// What a real bash offers for the last of `words`.
std::vector<std::string> completed(const std::string& words) {
  const TestApp test;
  const TemporaryFolder folder;
  const std::filesystem::path script = folder.path() / "fence.bash";
  EXPECT_TRUE(write_text(script, bash_completion(usage_of(test.app, "fence"))).has_value());
  const std::string command = "bash --norc -uc 'source " + script.string() + "; COMP_WORDS=(" +
                              words +
                              "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _fence; "
                              "printf \"%s\\n\" \"${COMPREPLY[@]}\"' 2>&1";
  std::vector<std::string> lines;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 256> line{};
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) {
    std::string text = line.data();
    while (text.ends_with('\n')) text.pop_back();
    if (!text.empty()) lines.push_back(text);
  }
  EXPECT_EQ(::pclose(pipe), 0) << command;
  return lines;
}

TEST(BashCompletion, OffersCommandsAndOptions) {
  EXPECT_THAT(completed("fence \"\""),
              IsSupersetOf({"wash", "--dry", "-c", "--colour", "--coats", "--help"}));
  EXPECT_THAT(completed("fence --co"), ElementsAre("--colour", "--coats"));
  EXPECT_THAT(completed("fence wa"), ElementsAre("wash"));
  EXPECT_THAT(completed("fence \"\""), Not(Contains("--secret")));
}

TEST(BashCompletion, KnowsWhichCommandItIsIn) {
  EXPECT_THAT(completed("fence --with"), IsEmpty());
  EXPECT_THAT(completed("fence wash --w"), ElementsAre("--with"));
  // Options that were declared before the command are still taken after it.
  EXPECT_THAT(completed("fence wash --d"), ElementsAre("--dry"));
}

TEST(BashCompletion, OffersWhatAValueMayBe) {
  EXPECT_THAT(completed("fence --colour \"\""), ElementsAre("green", "red-ish"));
  EXPECT_THAT(completed("fence wash -c r"), ElementsAre("red-ish"));
  // Anything: nothing of ours, so that bash offers files.
  EXPECT_THAT(completed("fence --coats \"\""), IsEmpty());
}

TEST(FishCompletion, QuotesWhatFishWouldRead) {
  TestApp test;
  test.app.get_option("--dry")->description("it's \\ a\nsecond line");
  EXPECT_THAT(fish_completion(usage_of(test.app, "fence")), testing::HasSubstr("'it\\'s \\\\ a'"));
}

TEST(ZshCompletion, PartsNamesFromTextsByColonsAlone) {
  TestApp test;
  const std::string script = zsh_completion(usage_of(test.app, "fence"));
  EXPECT_THAT(script, testing::StartsWith("#compdef fence\n"));
  EXPECT_THAT(script, testing::HasSubstr("'wash:Clean it first'"));
  EXPECT_THAT(script, testing::HasSubstr("don'\\''t"));
}

}  // namespace
}  // namespace veneer::manual
