// SPDX-License-Identifier: Apache-2.0
#include "capture/session/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/full_disk.h"
#include "base/testing/temporary_folder.h"
#include "capture/recording.h"

namespace veneer::capture {
namespace {

using testing::HasSubstr;

constexpr std::uint16_t kFull = 4095;

/// A small rig: hands, analyser and camera on one state. The light of a pixel depends on all of it.
class SmallRig final : public Camera, public Polariser, public Hands {
 public:
  // What goes wrong.
  int fail_at = -1;  ///< number of the call that fails
  Errc failure = Errc::kDisconnected;
  double dropped = 0;   ///< part of the grabs that time out
  double repeated = 0;  ///< part of the grabs that give the picture before once more
  bool moves = false;   ///< the sample, by a pixel at each grab after the first turn of a place
  double drift = 0;     ///< of the light, per turn of the analyser
  double brightness = 1;
  Mosaic mosaic = Mosaic::kNone;

  // What it was asked for.
  int calls = 0;
  int grabs = 0;
  int turns = 0;
  std::vector<HandRequest> requests;
  std::vector<std::string> said;

  [[nodiscard]] std::string description() const override { return "small rig"; }
  [[nodiscard]] int width() const override { return 32; }
  [[nodiscard]] int height() const override { return 24; }
  [[nodiscard]] ExposureRange exposure_range() const override { return {1e-5, 2}; }
  Status set_exposure(double seconds) override {
    if (!(seconds >= 1e-5 && seconds <= 2.0000001))
      return fail(Errc::kInvalidOption, "{} is out of range", seconds);
    exposure_ = seconds;
    return {};
  }
  Result<CameraFrame> grab() override {
    VENEER_TRY(count());
    ++grabs;
    clock.sleep_until(clock.now() + from_seconds(exposure_ + 0.01));
    if (random_.uniform() < dropped) return fail(Errc::kTimeout, "no picture came");
    if (random_.uniform() < repeated && last_.sequence != 0) return last_;
    last_ = {};
    last_.full_scale = kFull;
    last_.exposure_s = exposure_;
    last_.time = clock.now();
    last_.mosaic = mosaic;
    last_.sequence = ++sequence_;
    last_.counts = Image<Rgb16>(width(), height());
    for (int y = 0; y < height(); ++y) {
      for (int x = 0; x < width(); ++x) {
        const double electrons = 1 + 8 * (16 + light_at(x, y) * exposure_);
        const double noise = (random_.uniform() + random_.uniform() + random_.uniform() - 1.5) * 2;
        const double counts = (electrons + noise * std::sqrt(electrons)) / 8;
        last_.counts(x, y).fill(
            static_cast<std::uint16_t>(std::clamp(counts, 0.0, static_cast<double>(kFull))));
      }
    }
    return last_;
  }
  Status turn_to(double angle_rad) override {
    VENEER_TRY(count());
    ++turns;
    ++turns_here_;
    angle_ = angle_rad;
    clock.sleep_until(clock.now() + from_seconds(1));
    return {};
  }
  Status please(const HandRequest& request) override {
    VENEER_TRY(count());
    clock.sleep_until(clock.now() + from_seconds(10));
    requests.push_back(request);
    using Task = HandRequest::Task;
    if (request.task == Task::kPlaceTarget) target_ = request.target;
    if (request.task == Task::kPlaceView) view_ = request.index;
    if (request.task == Task::kPlaceLight) light_ = request.index;
    if (request.task == Task::kDarken) lit_ = false;
    if (request.task == Task::kLight) lit_ = true;
    if (request.task == Task::kPlaceTarget || request.task == Task::kPlaceLight) turns_here_ = 0;
    return {};
  }
  void say(std::string_view text) override { said.emplace_back(text); }

  VirtualClock clock;

 private:
  Status count() {
    if (calls++ == fail_at) return fail(failure, "the cable is out");
    return {};
  }
  /// Counts a second, at 8 electrons a count.
  [[nodiscard]] double light_at(int x, int y) const {
    if (!lit_) return 30;
    const double angle = mosaic == Mosaic::kNone ? angle_.value_or(0) : 0;
    const int shift = moves ? std::max(turns_here_ - 1, 0) : 0;
    const double board = ((x + shift) / 4 + y / 4) % 2 == 0 ? 0.2 : 1;
    const double diffuse = 20000 * board * (1 + 0.1 * light_.value_or(0));
    const double shine =
        target_ == Target::kSample ? 200000 * std::exp(-std::hypot(x - 16, y - 12)) : 0;
    const double cosine = std::cos(angle);
    return brightness * (1 + drift * turns_here_) *
           (30 + 0.5 * diffuse + shine * (cosine * cosine + 0.01));
  }
  std::optional<Target> target_;
  std::optional<int> view_, light_;
  std::optional<double> angle_;
  bool lit_ = true;
  int turns_here_ = 0;
  double exposure_ = 0;
  CameraFrame last_;
  std::uint64_t sequence_ = 0;
  Pcg32 random_{5};
};

CapturePlan plan_of(int lights) {
  CapturePlan plan;
  plan.name = "cloth";
  plan.area.width_mm = 40;
  plan.area.height_mm = 30;
  plan.exposure.most = 3;
  plan.exposure.frames = 1;
  plan.views = {btf::Direction(0, 0, 1)};
  for (int i = 0; i < lights; ++i) plan.lights.push_back(btf::direction_from_angles({0.2 * i, 0}));
  return plan;
}

Result<SessionOutcome> run(SmallRig& rig, const CapturePlan& plan, const TemporaryFolder& folder) {
  SilentProgress progress;
  const CaptureDevices devices{
      &rig, rig.mosaic == Mosaic::kNone ? &rig : nullptr, &rig, &rig.clock};
  return run_session(plan, folder.path() / "s", devices, progress);
}

/// All that the plan asks for is there, and is what it says to be.
void expect_complete(const TemporaryFolder& folder, const CapturePlan& plan, int analysers) {
  const auto recording = Recording::open(folder.path() / "s");
  ASSERT_TRUE(recording) << recording.error().what;
  std::map<std::tuple<Target, int, int>, std::map<std::pair<int, bool>, std::set<int>>> found;
  for (const Shot& shot : recording->shots()) {
    const auto picture = recording->picture(shot);
    ASSERT_TRUE(picture) << picture.error().what;
    found[{shot.target, shot.view, shot.light}][{shot.analyser, shot.dark}].insert(shot.exposure);
    double most = 0;
    for (const Rgb32f& pixel : picture->counts.pixels()) most = std::max<double>(most, pixel[0]);
    if (shot.exposure == 0) {
      EXPECT_LT(most, picture->full_scale) << recording->path_of(shot);
    }
    // Dark ones see 16 counts of offset and 30 a second.
    if (shot.dark) {
      EXPECT_LT(most, 16 + 30 * picture->exposure_s + 60) << recording->path_of(shot);
    }
    if (!shot.dark && shot.exposure == 0 && shot.analyser == 0) {
      EXPECT_GT(most, 0.4 * picture->full_scale) << recording->path_of(shot);
    }
    EXPECT_EQ(picture->frames, plan.exposure.frames);
  }
  const std::string journal = read_text(folder.path() / "s" / "journal.jsonl").value();
  std::size_t taken = 0;
  for (std::size_t at = 0; (at = journal.find("\"picture\"", at)) != std::string::npos; ++at)
    ++taken;
  EXPECT_EQ(taken, recording->shots().size());  // none twice
  const std::size_t lights = plan.lights.size() * plan.views.size();
  std::size_t places = 2 * lights + (plan.mirror_light ? 1 : 0);
  if (plan.light_source == LightSource::kMirrorBall) places += plan.lights.size();
  EXPECT_EQ(found.size(), places);
  for (const auto& [place, pictures] : found) {
    EXPECT_EQ(static_cast<int>(pictures.size()), analysers + 1);  // and the dark ones
    for (const auto& [which, exposures] : pictures) {
      EXPECT_EQ(exposures, pictures.begin()->second);  // the same bracket everywhere
      if (which.second) {
        EXPECT_EQ(which.first, 0);
      }
    }
  }
}

TEST(Session, TakesWhatThePlanAsksFor) {
  const TemporaryFolder folder;
  CapturePlan plan = plan_of(3);
  plan.views.push_back(btf::direction_from_angles({0.5, 1}));
  plan.mirror_light = 1;
  plan.light_source = LightSource::kMirrorBall;
  plan.exposure.frames = 3;
  SmallRig rig;
  const auto outcome = run(rig, plan, folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_THAT(outcome->warnings, testing::IsEmpty());
  EXPECT_EQ(outcome->recalled, 0);
  expect_complete(folder, plan, 2);
  // The least moving: every target once, lights forth and back, two turns of the analyser a place.
  const auto count = [&rig](HandRequest::Task task) {
    return std::ranges::count(rig.requests, task, &HandRequest::task);
  };
  EXPECT_EQ(count(HandRequest::Task::kPlaceTarget), 4);
  EXPECT_EQ(count(HandRequest::Task::kPlaceView), 4);
  EXPECT_LE(count(HandRequest::Task::kPlaceLight), 2 * 5 + 4);
  const int places = 2 * 2 * 3 + 1 + 3;
  EXPECT_EQ(count(HandRequest::Task::kDarken), places);
  EXPECT_EQ(rig.turns, 1 + 2 * places);
  for (const HandRequest& request : rig.requests) EXPECT_FALSE(request.text.empty());
}

TEST(Session, DoesNothingOnceItIsFinished) {
  const TemporaryFolder folder;
  SmallRig first;
  const auto taken = run(first, plan_of(1), folder);
  ASSERT_TRUE(taken) << taken.error().what;
  SmallRig rig;
  const auto outcome = run(rig, plan_of(1), folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_EQ(outcome->taken, 0);
  EXPECT_EQ(outcome->recalled, taken->taken);
  EXPECT_EQ(rig.calls, 0);
}

// Whenever a cable comes out or the person stops, and however often: every picture is taken once,
// and nobody is asked to place what is finished.
TEST(Session, GoesOnFromAnyInterruption) {
  const CapturePlan plan = plan_of(2);
  for (int every = 16; every < 60; every += 5) {
    const TemporaryFolder folder;
    int runs = 0;
    std::set<std::pair<Target, int>> finished;
    for (;; ++runs) {
      ASSERT_LT(runs, 60) << every;
      SmallRig rig;
      rig.fail_at = every;
      rig.failure = runs % 2 == 0 ? Errc::kDisconnected : Errc::kCancelled;
      const auto outcome = run(rig, plan, folder);
      // Placed is only what was not finished before.
      Target target = Target::kSample;
      for (const HandRequest& request : rig.requests) {
        if (request.task == HandRequest::Task::kPlaceTarget) target = request.target;
        if (request.task == HandRequest::Task::kPlaceLight) {
          EXPECT_FALSE(finished.contains({target, request.index})) << every;
        }
      }
      const auto recording = Recording::open(folder.path() / "s");
      ASSERT_TRUE(recording) << recording.error().what;
      const auto shots = recording->shots();
      for (const Target each : {Target::kWhite, Target::kSample}) {
        for (int light = 0; light < 2; ++light) {
          const auto count = std::ranges::count_if(
              shots, [&](const Shot& shot) { return shot.target == each && shot.light == light; });
          const std::string bracket =
              recording->noted(fmt::format("bracket {} 0 {}", text_of(each), light));
          const auto exposures = std::ranges::count(bracket, ',') + 1;
          if (!bracket.empty() && count == 3 * exposures) finished.insert({each, light});
        }
      }
      if (outcome) break;
      EXPECT_EQ(outcome.error().code, rig.failure);
      EXPECT_THAT(outcome.error().what, HasSubstr("the same command goes on from here"));
    }
    EXPECT_GT(runs, 0) << every;
    expect_complete(folder, plan, 2);
    SmallRig rig;
    const auto outcome = run(rig, plan, folder);
    ASSERT_TRUE(outcome);
    EXPECT_EQ(outcome->taken, 0);
    EXPECT_EQ(rig.calls, 0);
  }
}

TEST(Session, SurvivesDroppedAndRepeatedFrames) {
  const TemporaryFolder folder;
  SmallRig rig;
  rig.dropped = 0.15;
  rig.repeated = 0.15;
  CapturePlan plan = plan_of(2);
  plan.exposure.frames = 4;
  const auto outcome = run(rig, plan, folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_THAT(outcome->warnings, testing::IsEmpty());
  expect_complete(folder, plan, 2);
}

TEST(Session, GivesUpOnACameraThatGivesNothing) {
  for (const bool repeats : {false, true}) {
    const TemporaryFolder folder;
    SmallRig rig;
    (repeats ? rig.repeated : rig.dropped) = 1;
    const auto outcome = run(rig, plan_of(1), folder);
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().code, Errc::kTimeout);
    EXPECT_LT(rig.grabs, 10);
  }
}

TEST(Session, NoticesWhatMoves) {
  const TemporaryFolder folder;
  SmallRig rig;
  rig.moves = true;
  const auto outcome = run(rig, plan_of(1), folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  ASSERT_FALSE(outcome->warnings.empty());
  EXPECT_THAT(outcome->warnings,
              testing::Contains(HasSubstr("sample, view 0, light 0: something moved")));
  EXPECT_EQ(rig.said.size(), outcome->warnings.size());
  const auto recording = Recording::open(folder.path() / "s");
  ASSERT_TRUE(recording);
  EXPECT_THAT(recording->noted("movement sample 0 0"), HasSubstr("\"moved\":true"));
}

TEST(Session, NoticesALampThatDrifts) {
  const TemporaryFolder folder;
  SmallRig rig;
  rig.drift = 0.015;
  const auto outcome = run(rig, plan_of(1), folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_THAT(outcome->warnings, testing::Contains(HasSubstr("the light changed by +")));
  EXPECT_THAT(outcome->warnings, testing::Not(testing::Contains(HasSubstr("moved"))));
}

TEST(Session, SaysThatThereIsTooMuchOrTooLittleLight) {
  for (const auto& [brightness, text] :
       {std::pair(1e4, "saturated in the shortest"), std::pair(1e-3, "too little light")}) {
    const TemporaryFolder folder;
    SmallRig rig;
    rig.brightness = brightness;
    const auto outcome = run(rig, plan_of(1), folder);
    ASSERT_TRUE(outcome) << outcome.error().what;
    EXPECT_THAT(outcome->warnings, testing::Contains(HasSubstr(text)));
  }
}

TEST(Session, NeedsNoPolariserWhereTheSensorHasIts) {
  const TemporaryFolder folder;
  SmallRig rig;
  rig.mosaic = Mosaic::kPolarMono;
  const auto outcome = run(rig, plan_of(2), folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_EQ(rig.turns, 0);
  expect_complete(folder, plan_of(2), 1);
  EXPECT_EQ(
      Recording::open(folder.path() / "s")->picture({Target::kWhite, 0, 0, 0, 0, false})->mosaic,
      Mosaic::kPolarMono);
}

TEST(Session, RefusesAnotherPlansFolderAndAPlanWithoutLights) {
  const TemporaryFolder folder;
  SmallRig rig;
  rig.fail_at = 40;
  ASSERT_FALSE(run(rig, plan_of(2), folder));
  const auto other = run(rig, plan_of(3), folder);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, Errc::kInvalidOption);
  CapturePlan plan = plan_of(0);
  plan.light_source = LightSource::kProjector;
  plan.profile = "bench";
  const auto none = run(rig, plan, folder);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("no lights"));
}

// The journal is what reaches the limit.
TEST(Session, GoesOnAfterAFullDisk) {
  const TemporaryFolder folder;
  const int status = on_full_disk(3000, [&] {
    SmallRig rig;
    const auto outcome = run(rig, plan_of(2), folder);
    return !outcome && outcome.error().code == Errc::kIo ? 0 : 1;
  });
  ASSERT_EQ(status, 0);
  SmallRig rig;
  const auto outcome = run(rig, plan_of(2), folder);
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_GT(outcome->recalled, 0);
  EXPECT_GT(outcome->taken, 0);
  expect_complete(folder, plan_of(2), 2);
}

}  // namespace
}  // namespace veneer::capture
