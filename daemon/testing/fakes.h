// SPDX-License-Identifier: Apache-2.0
#pragma once

// Devices that do what they are told, and fail when they are told to. For tests only.

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "projector/output.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"
#include "tracking/tracker.h"

namespace veneer::daemon::testing {

/// What the fakes share with their test, which turns its switches from any thread.
struct Stagehand {
  std::atomic<bool> tracker_gone{false};      ///< wait_pose() says kDisconnected
  std::atomic<bool> tracker_silent{false};    ///< says kTimeout
  std::atomic<bool> tracker_refuses{false};   ///< cannot be opened
  std::atomic<int> trackers{0};               ///< how many were opened
  std::atomic<bool> output_away{false};       ///< present() says kUnavailable
  std::atomic<bool> output_broken{false};     ///< says kIo
  std::atomic<bool> output_stays_lit{false};  ///< blank() says kUnavailable
  std::atomic<bool> output_closed{false};     ///< says kCancelled
  std::atomic<bool> output_refuses{false};    ///< cannot be opened
  std::atomic<int> outputs{0};
  std::atomic<std::uint64_t> presented{0};
  std::atomic<int> blanks{0};
  std::atomic<bool> gpu_lost{false};          ///< of the renderers that there are
  std::atomic<bool> renderer_refuses{false};  ///< cannot be made
  std::atomic<int> renderers{0};
  std::atomic<int> alive{0};                ///< renderers that were not destroyed
  std::atomic<bool> dark{true};             ///< as the audience sees it
  std::atomic<int> ceiling{0};              ///< of the renderer whose frame was presented last
  std::atomic<double> given_distance_m{0};  ///< of the profile that a renderer was given last
  std::vector<double> level_ms;  ///< what a frame takes on each level; nothing where empty
};

/// A body that moves along x at 1 m/s and is measured every 4 ms; gone after `end`.
class MovingTracker final : public tracking::Tracker {
 public:
  MovingTracker(Clock& clock, Time first, Time end, Stagehand* hand = nullptr)
      : clock_(clock), next_(first), end_(end), hand_(hand) {}
  std::string description() const override { return "a moving body"; }
  Result<tracking::PoseSample> wait_pose(Duration timeout) override {
    constexpr Duration kStep = std::chrono::milliseconds(4);
    if (next_ > end_ || (hand_ != nullptr && hand_->tracker_gone))
      return fail(Errc::kDisconnected, "unplugged");
    const Time deadline = clock_.now() + timeout;
    if (hand_ != nullptr && hand_->tracker_silent) {
      clock_.sleep_until(deadline);
      next_ = std::max(next_, deadline);
      return fail(Errc::kTimeout, "silent");
    }
    clock_.sleep_until(std::min(next_, deadline));
    if (next_ > deadline) return fail(Errc::kTimeout, "nothing yet");
    tracking::PoseSample sample;
    sample.time = next_;
    sample.sequence = ++sequence_;
    sample.world_from_body.translation.x() = to_seconds(next_.time_since_epoch());
    next_ += kStep;
    return sample;
  }

 private:
  Clock& clock_;
  Time next_;
  Time end_;
  Stagehand* hand_;
  std::uint64_t sequence_ = 0;
};

/// Remembers what it was asked to draw, the last hundred thousand.
class FakeRenderer : public render::Renderer {
 public:
  explicit FakeRenderer(Stagehand& hand, int mark = 0) : hand_(hand), mark_(mark) {
    ++hand_.alive;
    born_lost_ = hand_.gpu_lost;
  }
  ~FakeRenderer() override { --hand_.alive; }
  void release() override {}
  bool lost() override {
    // Those that are made after a reset know nothing of it.
    if (hand_.gpu_lost && !born_lost_) lost_ = true;
    return lost_;
  }
  void draw_to_scanout(std::size_t /*buffer*/) override {}
  Status set_profile(const render::PreparedProfile& profile) override {
    hand_.given_distance_m = profile.profile().reference_distance_m;
    return {};
  }
  void draw(const render::FrameInput& input) override {
    EXPECT_FALSE(lost_) << "nothing is drawn with what is lost";
    inputs.push_back(input);
  }
  void read_codes(ImageView<Rgb16> codes) override {
    codes(0, 0) = {7, 8, static_cast<std::uint16_t>(9 + mark_)};
  }
  void read_target(ImageView<Rgb32f>) override {}
  void finish() override {
    if (hand_.level_ms.empty() || inputs.empty()) return;
    const render::FrameInput& input = inputs.back();
    const double ms = hand_.level_ms.at(input.level) * (1 - input.fade) +
                      hand_.level_ms.at(input.next_level) * input.fade;
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(ms));
  }
  render::FrameStatistics statistics() override {
    render::FrameStatistics statistics;
    statistics.gpu_ms = 0.5;
    statistics.draw_ms = 0.3;
    return statistics;
  }
  std::string description() const override { return "fake"; }
  std::vector<render::FrameInput> inputs;

 private:
  Stagehand& hand_;
  int mark_;
  bool born_lost_ = false;
  bool lost_ = false;
};

class FakeOutput : public projector::Output {
 public:
  explicit FakeOutput(Stagehand& hand) : hand_(hand) {}
  ~FakeOutput() override { hand_.dark = true; }
  std::string description() const override { return "fake"; }
  bool wants_pixels(std::uint64_t) const override { return true; }
  Status present(const projector::Frame& frame) override {
    if (hand_.output_closed) return fail(Errc::kCancelled, "the window was closed");
    if (hand_.output_away) return fail(Errc::kUnavailable, "unplugged");
    if (hand_.output_broken) return fail(Errc::kIo, "broken");
    EXPECT_EQ(frame.codes(0, 0)[0], 7);
    hand_.ceiling = frame.codes(0, 0)[2] - 9;
    hand_.dark = false;
    ++hand_.presented;
    times.push_back(frame.display_time);
    return {};
  }
  Status blank() override {
    if (hand_.output_stays_lit) return fail(Errc::kUnavailable, "it does not take a black picture");
    ++hand_.blanks;
    hand_.dark = true;
    return {};
  }
  std::vector<Time> times;

 private:
  Stagehand& hand_;
};

/// A display that shows a frame with the first refresh after it was handed over, one a refresh, and
/// says afterwards when that was.
class RefreshingOutput final : public projector::Output {
 public:
  RefreshingOutput(Clock& clock, Duration period, Time phase)
      : clock_(clock), period_(period), next_(phase) {}
  std::string description() const override { return "refreshing"; }
  bool wants_pixels(std::uint64_t) const override { return false; }
  std::optional<Duration> refresh_period() const override { return period_; }
  Status present(const projector::Frame& frame) override {
    // One may wait for its refresh; another waits until that has gone.
    clock_.sleep_until(next_);
    while (next_ <= clock_.now()) next_ += period_;
    shown_ = std::exchange(pending_, projector::Presented{frame.number, next_});
    return {};
  }
  std::optional<projector::Presented> last_presented() override {
    if (pending_ && pending_->time <= clock_.now()) return pending_;
    return shown_;
  }

 private:
  Clock& clock_;
  Duration period_;
  Time next_;
  std::optional<projector::Presented> pending_;
  std::optional<projector::Presented> shown_;
};

}  // namespace veneer::daemon::testing
