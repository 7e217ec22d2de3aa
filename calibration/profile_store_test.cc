// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <thread>
#include <vector>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::calibration {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Told apart by its reference distance.
ProjectorProfile profile_at(double metres) {
  ProjectorProfile p;
  p.geometry = {64, 48, 100.0, 100.0, 32.0, 24.0, {}};
  p.bits = 4;
  for (auto& curve : p.tone_curves)
    for (int code = 0; code < 16; ++code) curve.push_back(std::pow(code / 15.0, 2.2));
  p.primaries << 42, 34, 19, 22, 70, 8, 3, 11, 95;
  p.reference_distance_m = metres;
  p.vignetting = Image<float>(64, 48, 1.0F);
  p.residual = ColourResidual::sampled(
      9, [](const Eigen::Vector3d& t) -> Eigen::Vector3d { return 0.2 * t.minCoeff() * t; });
  return p;
}

class ProfileStoreTest : public ::testing::Test {
 protected:
  [[nodiscard]] double current() const {
    const auto loaded = ProjectorProfile::load(store_.folder());
    return loaded ? loaded->reference_distance_m : 0.0;
  }
  /// Newest first.
  [[nodiscard]] std::vector<double> older() const {
    std::vector<double> distances;
    const std::vector<fs::path> entries = store_.history().value();
    for (const fs::path& entry : entries)
      distances.push_back(ProjectorProfile::load(entry).value().reference_distance_m);
    return distances;
  }
  static void damage(const fs::path& profile) {
    std::string text = read_text(profile / "profile.json").value();
    text[text.size() / 2] ^= 1;
    ASSERT_TRUE(write_text(profile / "profile.json", text));
  }

  TemporaryFolder folder_;
  ProfileStore store_{folder_.path() / "projector", 3};
};

TEST_F(ProfileStoreTest, KeepsWhatItReplaces) {
  EXPECT_TRUE(store_.history().value().empty());
  for (const double metres : {1.0, 2.0, 3.0}) {
    const Status published = store_.publish(profile_at(metres));
    ASSERT_TRUE(published) << published.error().what;
    EXPECT_EQ(current(), metres);
  }
  EXPECT_EQ(older(), (std::vector{2.0, 1.0}));
}

TEST_F(ProfileStoreTest, KeepsNoMoreThanItWasTold) {
  for (int i = 1; i <= 7; ++i) ASSERT_TRUE(store_.publish(profile_at(i)));
  EXPECT_EQ(current(), 7.0);
  EXPECT_EQ(older(), (std::vector{6.0, 5.0, 4.0}));
}

TEST_F(ProfileStoreTest, OrdersTheHistoryEvenIfTheClockWasSetBack) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  ASSERT_TRUE(store_.publish(profile_at(2)));
  const fs::path kept = store_.history().value().front();
  const fs::path future = kept.parent_path() / "2999-12-31T23-59-59.999Z";
  fs::rename(kept, future);
  ASSERT_TRUE(store_.publish(profile_at(3)));
  EXPECT_EQ(older(), (std::vector{2.0, 1.0}));
  EXPECT_EQ(store_.history().value().front().filename(), "3000-01-01T00-00-00.000Z");
}

TEST_F(ProfileStoreTest, ExtraFilesArePublishedAndKept) {
  const auto extra = [](const fs::path& folder) { return write_text(folder / "a.icc", "one"); };
  ASSERT_TRUE(store_.publish(profile_at(1), extra));
  EXPECT_EQ(read_text(store_.folder() / "a.icc").value(), "one");
  ASSERT_TRUE(store_.publish(profile_at(2)));
  EXPECT_FALSE(fs::exists(store_.folder() / "a.icc"));
  ASSERT_TRUE(store_.roll_back());
  EXPECT_EQ(read_text(store_.folder() / "a.icc").value(), "one");
}

TEST_F(ProfileStoreTest, WhatIsNotValidReplacesNothing) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  ProjectorProfile bad = profile_at(2);
  bad.black.x() = -1;
  const Status refused = store_.publish(bad);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_EQ(current(), 1.0);
  EXPECT_TRUE(older().empty());
}

TEST_F(ProfileStoreTest, ADamagedCurrentOneIsReplacedAndNotKept) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  ASSERT_TRUE(store_.publish(profile_at(2)));
  damage(store_.folder());
  ASSERT_TRUE(store_.publish(profile_at(3)));
  EXPECT_EQ(current(), 3.0);
  EXPECT_EQ(older(), (std::vector{1.0}));
}

TEST_F(ProfileStoreTest, LoadsTheNewestGoodOneAndSaysWhich) {
  EXPECT_EQ(store_.load_newest_good().error().code, Errc::kNotFound);
  for (const double metres : {1.0, 2.0, 3.0}) ASSERT_TRUE(store_.publish(profile_at(metres)));
  auto loaded = store_.load_newest_good();
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->profile.reference_distance_m, 3.0);
  EXPECT_EQ(loaded->warning, "");

  damage(store_.folder());
  damage(store_.history().value().front());
  loaded = store_.load_newest_good();
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_EQ(loaded->profile.reference_distance_m, 1.0);
  EXPECT_EQ(loaded->from, store_.history().value().back());
  EXPECT_THAT(loaded->warning, HasSubstr("changed or damaged"));
  EXPECT_THAT(loaded->warning, HasSubstr(loaded->from.string()));

  damage(store_.history().value().back());
  loaded = store_.load_newest_good();
  ASSERT_FALSE(loaded);
  EXPECT_THAT(loaded.error().what, HasSubstr(store_.folder().string()));
}

TEST_F(ProfileStoreTest, RollsBackToTheLastOneAndTwiceChangesNothing) {
  EXPECT_EQ(store_.roll_back().error().code, Errc::kNotFound);
  ASSERT_TRUE(store_.publish(profile_at(1)));
  EXPECT_EQ(store_.roll_back().error().code, Errc::kNotFound);
  ASSERT_TRUE(store_.publish(profile_at(2)));
  ASSERT_TRUE(store_.roll_back());
  EXPECT_EQ(current(), 1.0);
  ASSERT_TRUE(store_.roll_back());
  EXPECT_EQ(current(), 2.0);
}

TEST_F(ProfileStoreTest, RollsBackToTheOneThatIsNamed) {
  for (int i = 1; i <= 4; ++i) ASSERT_TRUE(store_.publish(profile_at(i)));
  const fs::path oldest = store_.history().value().back();
  // Keeping the current one pushes the chosen one out of a history of three.
  const auto chosen = store_.roll_back(oldest);
  ASSERT_TRUE(chosen) << chosen.error().what;
  EXPECT_EQ(*chosen, oldest);
  EXPECT_EQ(current(), 1.0);
  EXPECT_EQ(older(), (std::vector{4.0, 3.0, 2.0}));
  EXPECT_EQ(store_.roll_back("/elsewhere").error().code, Errc::kNotFound);
  damage(store_.history().value()[1]);
  EXPECT_EQ(store_.roll_back(store_.history().value()[1]).error().code, Errc::kBadFormat);
  EXPECT_EQ(current(), 1.0);
}

TEST_F(ProfileStoreTest, RollsBackFromADamagedOne) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  ASSERT_TRUE(store_.publish(profile_at(2)));
  damage(store_.folder());
  ASSERT_TRUE(store_.roll_back());
  EXPECT_EQ(current(), 1.0);
}

TEST_F(ProfileStoreTest, WhatWasLeftByAKilledRemovalIsNoEntryAndGoes) {
  for (int i = 1; i <= 3; ++i) ASSERT_TRUE(store_.publish(profile_at(i)));
  const fs::path half = store_.history().value().back();
  fs::remove(half / "profile.json");
  EXPECT_EQ(older(), (std::vector{2.0}));
  ASSERT_TRUE(store_.publish(profile_at(4)));
  EXPECT_FALSE(fs::exists(half));
}

/// Runs `work` in a child process and returns its exit status; `kill_after` < 0: lets it finish.
template <class Work>
int in_a_child(const Work& work, std::chrono::microseconds kill_after) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  if (kill_after.count() >= 0) {
    std::this_thread::sleep_for(kill_after);
    ::kill(child, SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

TEST_F(ProfileStoreTest, KilledAtAnyMomentItLeavesAGoodProfileAndGoesOn) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  // How long one takes here, so that the moments fall within it.
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(store_.publish(profile_at(2)));
  const auto once = std::chrono::steady_clock::now() - begin;
  Pcg32 random(31);
  int killed = 0;
  for (int i = 3; i < 43; ++i) {
    const double before = current();
    const auto moment =
        std::chrono::duration_cast<std::chrono::microseconds>(1.5 * random.uniform() * once);
    const int status =
        in_a_child([&] { static_cast<void>(store_.publish(profile_at(i))); }, moment);
    if (WIFSIGNALED(status)) ++killed;
    const double after = current();
    ASSERT_TRUE(after == before || after == i) << "killed after " << moment.count() << " us";
    const auto entries = store_.history();
    ASSERT_TRUE(entries);
    for (const fs::path& entry : *entries) ASSERT_TRUE(ProjectorProfile::load(entry)) << entry;
  }
  EXPECT_GT(killed, 5) << "the moments were no test";
  ASSERT_TRUE(store_.publish(profile_at(99)));
  EXPECT_EQ(current(), 99.0);
  EXPECT_EQ(older().size(), 3U);
}

// Every step of publishing, found by letting files grow to ever more bytes: wherever it fails, the
// old profile stays, and the text says that writing failed.
TEST_F(ProfileStoreTest, OnAFullDiskTheOldProfileStays) {
  ASSERT_TRUE(store_.publish(profile_at(1)));
  ASSERT_TRUE(store_.publish(profile_at(2)));
  int refused = 0;
  int published = 0;
  for (rlim_t bytes = 0; bytes < 20000; bytes += 500) {
    const double before = current();
    const int status = in_a_child(
        [&] {
          std::signal(SIGXFSZ, SIG_IGN);  // writing fails with EFBIG instead
          const rlimit limit{bytes, bytes};
          ::setrlimit(RLIMIT_FSIZE, &limit);
          const Status done = store_.publish(profile_at(3));
          ::_exit(done ? 0 : done.error().code == Errc::kIo && !done.error().what.empty() ? 1 : 2);
        },
        std::chrono::microseconds(-1));
    ASSERT_TRUE(WIFEXITED(status)) << bytes << " bytes";
    ASSERT_LT(WEXITSTATUS(status), 2) << bytes << " bytes: another error than one of writing";
    if (WEXITSTATUS(status) == 0) {
      ++published;
      EXPECT_EQ(current(), 3.0) << bytes << " bytes";
    } else {
      ++refused;
      EXPECT_EQ(current(), before) << bytes << " bytes";
    }
  }
  EXPECT_GT(refused, 3);
  EXPECT_GT(published, 0);
}

}  // namespace
}  // namespace veneer::calibration
