// SPDX-License-Identifier: Apache-2.0
#include "base/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/files.h"
#include "base/testing/full_disk.h"
#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr JournalKind kKind{"test", "opening", "somebody has it", "begin again with --restart"};
const json kIdentity{{"projector", "bench"}, {"raster", {640, 480, 8}}};

Result<Journal> open(const TemporaryFolder& folder, const json& identity = kIdentity) {
  return Journal::open(kKind, folder.path() / "session", identity);
}
std::filesystem::path file_of(const TemporaryFolder& folder) {
  return folder.path() / "session" / "journal.jsonl";
}

TEST(Journal, KeepsFindingsAndForgetsSteps) {
  const TemporaryFolder folder;
  {
    auto journal = open(folder);
    ASSERT_TRUE(journal) << journal.error().what;
    EXPECT_FALSE(journal->resumed());
    ASSERT_TRUE(journal->add("light", "white", {1.5, 2.25, 1e-300}));
    ASSERT_TRUE(journal->add("light", "black", 0.1));
    ASSERT_TRUE(journal->add("light", "black", 0.2));  // the later one counts
    ASSERT_TRUE(journal->add("geometry", "pose 1", nullptr));
    ASSERT_TRUE(journal->add("room", "x", 1));
    ASSERT_TRUE(journal->forget("room"));
    ASSERT_TRUE(journal->forget("nothing"));
  }
  const auto journal = open(folder);
  ASSERT_TRUE(journal) << journal.error().what;
  EXPECT_TRUE(journal->resumed());
  EXPECT_EQ(journal->size(), 3U);
  ASSERT_NE(journal->find("light", "white"), nullptr);
  EXPECT_EQ(*journal->find("light", "white"), json({1.5, 2.25, 1e-300}));  // to the last bit
  EXPECT_EQ(*journal->find("light", "black"), json(0.2));
  EXPECT_TRUE(journal->find("geometry", "pose 1")->is_null());
  EXPECT_EQ(journal->find("room", "x"), nullptr);
}

// Whatever the power left of the last lines: what was complete is there, and it can be gone on
// with.
TEST(Journal, SurvivesBeingCutAnywhere) {
  const TemporaryFolder folder;
  {
    auto journal = open(folder);
    ASSERT_TRUE(journal);
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(journal->add("light", std::to_string(i), i));
  }
  const std::string whole = read_text(file_of(folder)).value();
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    for (const bool zeros : {false, true}) {
      std::string left = whole.substr(0, length);
      const auto lines = std::count(left.begin(), left.end(), '\n');
      // A file system may keep a line's length and lose its bytes.
      if (zeros) left += std::string(7, '\0');
      ASSERT_TRUE(write_text(file_of(folder), left));
      auto journal = open(folder);
      ASSERT_TRUE(journal) << length << ": " << journal.error().what;
      EXPECT_EQ(static_cast<std::ptrdiff_t>(journal->size()),
                std::max<std::ptrdiff_t>(lines - 1, 0))
          << length;
      ASSERT_TRUE(journal->add("light", "after", 7));
      const std::size_t size = journal->size();
      journal = fail(Errc::kCancelled, "closed");  // lets go of the lock
      const auto again = open(folder);
      ASSERT_TRUE(again) << length << ": " << again.error().what;
      EXPECT_EQ(again->size(), size) << length;
    }
  }
}

TEST(Journal, RefusesDamageInItsMiddle) {
  const TemporaryFolder folder;
  {
    auto journal = open(folder);
    ASSERT_TRUE(journal);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(journal->add("light", std::to_string(i), i));
  }
  std::string text = read_text(file_of(folder)).value();
  text[text.find('\n') + 3] = '\1';
  ASSERT_TRUE(write_text(file_of(folder), text));
  const auto journal = open(folder);
  ASSERT_FALSE(journal);
  EXPECT_EQ(journal.error().code, Errc::kBadFormat);
  EXPECT_THAT(journal.error().what, HasSubstr("--restart"));
  EXPECT_EQ(read_text(file_of(folder)).value(), text);  // nothing lost by looking
}

TEST(Journal, RefusesOtherConditionsAndNamesThem) {
  const TemporaryFolder folder;
  {
    auto journal = open(folder);
    ASSERT_TRUE(journal);
    ASSERT_TRUE(journal->add("light", "x", 1));
  }
  json other = kIdentity;
  other["projector"] = "another";
  const auto journal = open(folder, other);
  ASSERT_FALSE(journal);
  EXPECT_EQ(journal.error().code, Errc::kInvalidOption);
  EXPECT_THAT(journal.error().what, HasSubstr("projector"));
  EXPECT_THAT(journal.error().what, HasSubstr("another"));
  ASSERT_TRUE(write_text(file_of(folder), "{\"format\":\"something\"}\n{\"step\":\"x\"}\n"));
  EXPECT_FALSE(open(folder));
}

TEST(Journal, IsOpenToOneAtATime) {
  const TemporaryFolder folder;
  const auto first = open(folder);
  ASSERT_TRUE(first);
  const auto second = open(folder);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kUnavailable);
}

TEST(Journal, AFullDiskCostsOnlyTheFindingThatDidNotFit) {
  const TemporaryFolder folder;
  const int status = on_full_disk(400, [&] {
    auto journal = open(folder);
    if (!journal) return 11;
    int kept = 0;
    Status added;
    while ((added = journal->add("light", std::to_string(kept), kept))) ++kept;
    const bool explained = added.error().code == Errc::kIo &&
                           added.error().what.find("make room") != std::string::npos;
    return explained && kept <= 90 ? 100 + kept : 12;
  });
  ASSERT_GE(status, 101) << "at least one finding must have fitted";
  const auto journal = open(folder);
  ASSERT_TRUE(journal) << journal.error().what;
  EXPECT_EQ(static_cast<int>(journal->size()), status - 100);
}

}  // namespace
}  // namespace veneer
