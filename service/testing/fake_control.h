// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "service/control.h"

namespace veneer::service {

/// For tests: a daemon without frames, which notes what it is told and says what it is given to
/// say. All of it may be called on any thread.
class FakeControl final : public ServiceControl {
 public:
  /// Changes what status() says.
  void change(const std::function<void(ServiceStatus&)>& change) {
    const std::scoped_lock lock(mutex_);
    change(status_);
  }
  void advance(std::uint64_t frames) { frames_ += frames; }
  /// Frames that the display does not take.
  void refuse(std::uint64_t frames) { refused_ += frames; }
  /// Every command from now on is refused with this; nothing: they are accepted.
  void refuse_with(std::optional<Error> error) {
    const std::scoped_lock lock(mutex_);
    refusal_ = std::move(error);
  }
  /// While it is held, commands take as long as that; all but Blank, which waits for no other.
  void hold(bool on) { hold(held_, on); }
  /// The same of Blank.
  void hold_blanks(bool on) { hold(blanks_held_, on); }
  /// What it was told: "material /a", "light 1 0 0 1 500 1 1 1", in order.
  [[nodiscard]] std::vector<std::string> told() const {
    const std::scoped_lock lock(mutex_);
    return told_;
  }
  [[nodiscard]] std::uint64_t times_asked() const { return asked_; }

  [[nodiscard]] ServiceStatus status() const override {
    ++asked_;
    const std::scoped_lock lock(mutex_);
    ServiceStatus status = status_;
    status.frames = frames_;
    return status;
  }
  [[nodiscard]] std::uint64_t frames() const override { return frames_; }
  [[nodiscard]] std::uint64_t turns() const override { return frames_ + refused_; }
  [[nodiscard]] Status load_material(const std::filesystem::path& material) override {
    return note("material " + material.string());
  }
  [[nodiscard]] Status set_scene(const std::filesystem::path& scene) override {
    return note("scene " + scene.string());
  }
  [[nodiscard]] Status set_light(int index, const LightSetting& light) override {
    const Eigen::Vector3d& d = light.direction_to_light;
    const Eigen::Vector3d& c = light.colour;
    return note(fmt::format("light {} {} {} {} {} {} {} {}",
                            index,
                            d.x(),
                            d.y(),
                            d.z(),
                            light.illuminance_lux,
                            c.x(),
                            c.y(),
                            c.z()));
  }
  [[nodiscard]] Status blank(bool on) override {
    VENEER_TRY(note(on ? "blank" : "unblank", blanks_held_));
    change([&](ServiceStatus& s) { s.state = on ? State::kBlank : State::kRunning; });
    return {};
  }
  [[nodiscard]] Status reload() override { return note("reload"); }
  [[nodiscard]] Result<std::filesystem::path> snapshot() override {
    VENEER_TRY(note("snapshot"));
    return std::filesystem::path("/var/lib/veneer/snapshot.png");
  }

 private:
  void hold(bool& held, bool on) {
    {
      const std::scoped_lock lock(mutex_);
      held = on;
    }
    released_.notify_all();
  }
  Status note(std::string what) { return note(std::move(what), held_); }
  Status note(std::string what, const bool& held) {
    std::unique_lock lock(mutex_);
    told_.push_back(std::move(what));
    released_.wait(lock, [&] { return !held; });
    if (refusal_) return tl::unexpected(*refusal_);
    return {};
  }

  mutable std::mutex mutex_;
  std::condition_variable released_;
  ServiceStatus status_;
  std::vector<std::string> told_;
  std::optional<Error> refusal_;
  bool held_ = false;
  bool blanks_held_ = false;
  std::atomic<std::uint64_t> frames_{0};
  std::atomic<std::uint64_t> refused_{0};
  mutable std::atomic<std::uint64_t> asked_{0};
};

/// A status no member of which is as it is at first.
[[nodiscard]] inline ServiceStatus busy_status() {
  ServiceStatus status;
  status.state = State::kDegraded;
  status.faults = {
      {FaultKind::kTracker,
       Time{std::chrono::microseconds(12'345'678)},
       "waiting for poses: none came for 2 s; is the cable plugged in?"},
      {FaultKind::kDisk, Time{std::chrono::hours(30)}, "writing: \"disk\" full \u00e9"}};
  status.material = "/m/leather.safetensors (cpca)";
  status.profile = "/p/left";
  status.scene = "/s/vase.toml";
  status.tracker = "hydra: silent";
  status.output = "kms HDMI-A-1 1920x1080";
  status.renderer = "llvmpipe";
  status.projector = "on, 1200 h";
  status.frames = 123456789012345;
  status.dropped = 3;
  status.late = 5;
  status.recovered = 7;
  status.frame_rate_hz = 59.94;
  status.frame_ms_median = 4.25;
  status.frame_ms_p95 = 6.5;
  status.gpu_ms_median = 2.125;
  double value = 0.25;
  for (const LatencyStage& stage : kLatencyStages) status.latency_ms.*stage.milliseconds = value++;
  status.quality = "half the clusters";
  status.luminance_ceiling = 400;
  return status;
}

}  // namespace veneer::service
