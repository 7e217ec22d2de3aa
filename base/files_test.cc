// SPDX-License-Identifier: Apache-2.0
#include "base/files.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

std::size_t entries(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), {}));
}

TEST(ReadText, RefusesADeviceWhoseTextHasNoEnd) {
  for (const char* device : {"/dev/zero", "/dev/null"}) {
    const auto text = read_text(device);
    ASSERT_FALSE(text) << device;
    EXPECT_NE(text.error().what.find("device"), std::string::npos);
  }
}

TEST(WriteText, RoundTripsAndMakesFolders) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a" / "b.txt";
  const std::string text("zero \0 inside", 13);
  ASSERT_TRUE(write_text(path, text));
  EXPECT_EQ(read_text(path).value(), text);
  EXPECT_EQ(entries(path.parent_path()), 1U) << "nothing may be left beside the file";
}

TEST(WriteText, KeepsTheOldFileWhereItCannotWrite) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "file", "old"));
  const Status status = write_text(folder.path() / "file" / "below", "new");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kIo);
  EXPECT_EQ(read_text(folder.path() / "file").value(), "old");
}

TEST(ReadText, NamesTheMissingFile) {
  const Result<std::string> text = read_text("no-such-file.toml");
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().code, Errc::kNotFound);
  EXPECT_NE(text.error().what.find("no-such-file.toml"), std::string::npos);
}

TEST(StagedFile, LeavesNothingWithoutCommit) {
  const TemporaryFolder folder;
  {
    auto staged = StagedFile::create(folder.path() / "file");
    ASSERT_TRUE(staged);
    std::ofstream(staged->path()) << "half";
  }
  EXPECT_EQ(entries(folder.path()), 0U);
}

TEST(StagedFolder, ReplacesTheOldOneWhole) {
  const TemporaryFolder folder;
  const fs::path final_path = folder.path() / "set.btfset";
  fs::create_directories(final_path);
  ASSERT_TRUE(write_text(final_path / "old.csv", "old"));
  auto staged = StagedFolder::create(final_path);
  ASSERT_TRUE(staged);
  ASSERT_TRUE(write_text(staged->path() / "new.csv", "new"));
  EXPECT_TRUE(fs::exists(final_path / "old.csv")) << "the old one stays until commit";
  ASSERT_TRUE(staged->commit());
  EXPECT_FALSE(fs::exists(final_path / "old.csv"));
  EXPECT_EQ(read_text(final_path / "new.csv").value(), "new");
  EXPECT_EQ(entries(folder.path()), 1U);
}

TEST(StagedFolder, IsNeverAbsentWhileItIsReplaced) {
  const TemporaryFolder folder;
  const fs::path final_path = folder.path() / "set";
  fs::create_directories(final_path);
  std::atomic<bool> stop{false};
  std::atomic<int> absent{0};
  std::thread reader([&] {
    while (!stop) {
      if (!fs::exists(final_path)) ++absent;
    }
  });
  for (int i = 0; i < 100; ++i) {
    auto staged = StagedFolder::create(final_path);
    EXPECT_TRUE(staged && staged->commit());
  }
  stop = true;
  reader.join();
  EXPECT_EQ(absent, 0);
  EXPECT_EQ(entries(folder.path()), 1U);
}

TEST(StagedFolder, KeepsTheOldOneWhereTheStagedOneIsGone) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "set" / "old.csv", "old"));
  auto staged = StagedFolder::create(folder.path() / "set");
  ASSERT_TRUE(staged);
  fs::remove_all(staged->path());
  const Status status = staged->commit();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kIo);
  EXPECT_EQ(read_text(folder.path() / "set" / "old.csv").value(), "old");
}

TEST(StagedFolder, RemovesWhatKilledProgramsLeft) {
  const TemporaryFolder folder;
  const auto hour_ago = fs::file_time_type::clock::now() - std::chrono::hours(1);
  const fs::path stale = folder.path() / ".set.veneer-aBc123";
  ASSERT_TRUE(write_text(stale / "half.csv", "half"));
  const fs::path stale_file = folder.path() / ".set.veneer-dEf456";
  ASSERT_TRUE(write_text(stale_file, "half"));
  const fs::path young = folder.path() / ".set.veneer-gHi789";
  ASSERT_TRUE(write_text(young / "half.csv", "half"));
  const fs::path foreign = folder.path() / ".set.backup";
  ASSERT_TRUE(write_text(foreign, "precious"));
  auto busy = StagedFolder::create(folder.path() / "set");
  ASSERT_TRUE(busy);
  for (const fs::path& old : {stale, stale_file, foreign, busy->path()})
    fs::last_write_time(old, hour_ago);
  const auto staged = StagedFolder::create(folder.path() / "set");
  ASSERT_TRUE(staged);
  EXPECT_FALSE(fs::exists(stale));
  EXPECT_FALSE(fs::exists(stale_file));
  EXPECT_TRUE(fs::exists(young)) << "it may not be locked yet";
  EXPECT_TRUE(fs::exists(foreign));
  EXPECT_TRUE(fs::exists(busy->path())) << "its owner lives";
  ASSERT_TRUE(busy->commit());
  EXPECT_TRUE(fs::is_directory(folder.path() / "set"));
}

TEST(StagedFolder, TakesATrailingSlash) {
  const TemporaryFolder folder;
  auto staged = StagedFolder::create(folder.path() / "set.btfset/");
  ASSERT_TRUE(staged);
  ASSERT_TRUE(staged->commit());
  EXPECT_TRUE(fs::is_directory(folder.path() / "set.btfset"));
}

TEST(StagedFolder, DoesNotOverwriteAFile) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "set", "precious"));
  auto staged = StagedFolder::create(folder.path() / "set");
  ASSERT_TRUE(staged);
  EXPECT_FALSE(staged->commit());
  EXPECT_EQ(read_text(folder.path() / "set").value(), "precious");
}

}  // namespace
}  // namespace veneer
