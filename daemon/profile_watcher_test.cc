// SPDX-License-Identifier: Apache-2.0
#include "daemon/profile_watcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <future>
#include <thread>
#include <utility>
#include <vector>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "calibration/profile_store.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;

/// Told apart by its reference distance.
calibration::ProjectorProfile profile_at(double metres, int width = 16) {
  calibration::ProjectorProfile p;
  p.geometry = {width, 12, 20.0, 20.0, 8.0, 6.0, {}};
  p.bits = 8;
  for (auto& curve : p.tone_curves)
    for (int code = 0; code < 256; ++code) curve.push_back(std::pow(code / 255.0, 2.2));
  p.primaries << 42, 34, 19, 22, 70, 8, 3, 11, 95;
  p.reference_distance_m = metres;
  p.vignetting = Image<float>(2, 2, 1.0F);
  return p;
}

/// Remembers which profiles it was given, and refuses them if it is told to.
class RememberingRenderer final : public render::Renderer {
 public:
  void release() override {}
  bool lost() override { return false; }
  void draw_to_scanout(std::size_t /*buffer*/) override {}
  Status set_profile(const render::PreparedProfile& profile) override {
    if (refuses) return fail(Errc::kUnavailable, "the driver says no");
    distances.push_back(profile.profile().reference_distance_m);
    return {};
  }
  void draw(const render::FrameInput&) override {}
  void read_codes(ImageView<Rgb16>) override {}
  void read_target(ImageView<Rgb32f>) override {}
  void finish() override {}
  render::FrameStatistics statistics() override { return {}; }
  std::string description() const override { return "remembering"; }
  std::vector<double> distances;
  bool refuses = false;
};

const auto kDrawing = [] { return true; };

class ProfileWatcherTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(store_.publish(profile_at(1))); }
  /// A watcher that looks all the time, or (`interval`) only when it is asked to.
  [[nodiscard]] ProfileWatcher watch(std::chrono::milliseconds interval = 2ms) {
    return {store_.folder(),
            identify(store_.folder() / "profile.json"),
            {16, 12, 8},
            {},
            [this](const Status& status) { heard_.push_back(status.has_value()); },
            {interval}};
  }
  /// Draws frames until `done`; false if that takes a minute, which is enough on any machine.
  bool frames_until(ProfileWatcher& watcher, const std::function<bool()>& done) {
    for (int i = 0; i < 60000 && !done(); ++i) {
      watcher.apply(renderer_);
      std::this_thread::sleep_for(1ms);
    }
    return done();
  }

  TemporaryFolder folder_;
  calibration::ProfileStore store_{folder_.path() / "profile"};
  RememberingRenderer renderer_;
  std::vector<bool> heard_;  // of the watching thread until it has stopped
};

TEST_F(ProfileWatcherTest, GivesEveryNewProfileToTheRenderer) {
  ProfileWatcher watcher = watch();
  for (const double metres : {2.0, 3.0, 4.0}) {
    ASSERT_TRUE(store_.publish(profile_at(metres)));
    ASSERT_TRUE(frames_until(watcher, [&] {
      return !renderer_.distances.empty() && renderer_.distances.back() == metres;
    })) << metres;
  }
  watcher.stop();
  EXPECT_EQ(renderer_.distances, (std::vector{2.0, 3.0, 4.0}));
  EXPECT_EQ(watcher.counts().reloads, 3U);
  EXPECT_EQ(watcher.counts().refusals, 0U);
}

TEST_F(ProfileWatcherTest, LeavesTheRendererAloneWhileNothingChanges) {
  ProfileWatcher watcher = watch();
  for (int i = 0; i < 100; ++i) {
    watcher.apply(renderer_);
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(renderer_.distances.empty());
}

TEST_F(ProfileWatcherTest, SeesOneThatCameBeforeItBegan) {
  const auto known = identify(store_.folder() / "profile.json");
  ASSERT_TRUE(store_.publish(profile_at(2)));
  ProfileWatcher watcher(store_.folder(), known, {16, 12, 8}, {}, {}, {2ms});
  EXPECT_TRUE(frames_until(watcher, [&] { return renderer_.distances == std::vector{2.0}; }));
}

TEST_F(ProfileWatcherTest, RefusesADamagedOneOnceAndTakesTheNextGoodOne) {
  ProfileWatcher watcher = watch();
  const std::filesystem::path manifest = store_.folder() / "profile.json";
  std::string text = read_text(manifest).value();
  text[text.size() / 2] ^= 1;
  ASSERT_TRUE(write_text(manifest, text));
  ASSERT_TRUE(frames_until(watcher, [&] { return watcher.counts().refusals == 1; }));
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(watcher.counts().refusals, 1U) << "it did not change since";
  EXPECT_TRUE(renderer_.distances.empty());
  ASSERT_TRUE(store_.publish(profile_at(2)));
  EXPECT_TRUE(frames_until(watcher, [&] { return renderer_.distances == std::vector{2.0}; }));
}

TEST_F(ProfileWatcherTest, RefusesOneForAnotherRaster) {
  ProfileWatcher watcher = watch();
  ASSERT_TRUE(store_.publish(profile_at(2, 17)));
  ASSERT_TRUE(frames_until(watcher, [&] { return watcher.counts().refusals == 1; }));
  EXPECT_TRUE(renderer_.distances.empty());
}

TEST_F(ProfileWatcherTest, CountsWhatTheRendererRefuses) {
  renderer_.refuses = true;
  ProfileWatcher watcher = watch();
  ASSERT_TRUE(store_.publish(profile_at(2)));
  ASSERT_TRUE(frames_until(watcher, [&] { return watcher.counts().refusals == 1; }));
  EXPECT_EQ(watcher.counts().reloads, 0U);
}

TEST_F(ProfileWatcherTest, WaitsWhileThereIsNoProfile) {
  ProfileWatcher watcher = watch();
  std::filesystem::rename(store_.folder(), folder_.path() / "away");
  std::this_thread::sleep_for(50ms);
  std::filesystem::rename(folder_.path() / "away", store_.folder());
  ASSERT_TRUE(store_.publish(profile_at(2)));
  EXPECT_TRUE(frames_until(watcher, [&] { return renderer_.distances == std::vector{2.0}; }));
  EXPECT_EQ(watcher.counts().refusals, 0U);
}

TEST_F(ProfileWatcherTest, ReadsAtOnceWhenAskedEvenWhatDidNotChange) {
  ProfileWatcher watcher = watch(1h);
  ASSERT_TRUE(store_.publish(profile_at(2)));
  for (const std::size_t times : {1U, 2U}) {
    auto answer = std::async(std::launch::async, [&] { return watcher.check(60s, kDrawing); });
    ASSERT_TRUE(
        frames_until(watcher, [&] { return answer.wait_for(0s) == std::future_status::ready; }));
    EXPECT_TRUE(answer.get());
    EXPECT_EQ(renderer_.distances, std::vector(times, 2.0));
  }
}

TEST_F(ProfileWatcherTest, SaysWhyWhatWasAskedForIsRefused) {
  ProfileWatcher watcher = watch(1h);
  ASSERT_TRUE(store_.publish(profile_at(2, 17)));
  const Status refused = watcher.check(60s, kDrawing);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  ASSERT_TRUE(store_.publish(profile_at(2)));
  const Status nobody_draws = watcher.check(300ms, kDrawing);
  ASSERT_FALSE(nobody_draws);
  EXPECT_EQ(nobody_draws.error().code, Errc::kTimeout);
  const Status cannot_draw = watcher.check(60s, [] { return false; });
  ASSERT_FALSE(cannot_draw);
  EXPECT_EQ(cannot_draw.error().code, Errc::kUnavailable);
}

TEST_F(ProfileWatcherTest, SaysOnceThatTheFolderIsGoneAndThatItIsBack) {
  ProfileWatcher watcher = watch();
  std::filesystem::rename(store_.folder(), folder_.path() / "away");
  std::this_thread::sleep_for(100ms);
  std::filesystem::rename(folder_.path() / "away", store_.folder());
  std::this_thread::sleep_for(100ms);
  watcher.stop();
  EXPECT_EQ(heard_, (std::vector{false, true}));
}

TEST_F(ProfileWatcherTest, TheNewestOvertakesOneThatNoFrameTook) {
  ProfileWatcher watcher = watch();
  for (const double metres : {2.0, 3.0}) {
    ASSERT_TRUE(store_.publish(profile_at(metres)));
    std::this_thread::sleep_for(300ms);  // no frames meanwhile
  }
  ASSERT_TRUE(frames_until(
      watcher, [&] { return !renderer_.distances.empty() && renderer_.distances.back() == 3.0; }));
}

}  // namespace
}  // namespace veneer::daemon
