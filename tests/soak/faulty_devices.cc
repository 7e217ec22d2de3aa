// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/faulty_devices.h"

#include <chrono>
#include <limits>
#include <thread>
#include <utility>

#include "base/toml_reader.h"
#include "tracking/drivers.h"

namespace veneer::soak {
namespace {

using namespace std::chrono_literals;

/// Longer than a frame at 30 Hz, and far shorter than anything that watches.
constexpr Duration kSlow = 80ms;

class FaultyTracker final : public tracking::Tracker {
 public:
  FaultyTracker(std::unique_ptr<tracking::Tracker> inner, Clock& clock, Switches& switches)
      : inner_(std::move(inner)), clock_(clock), switches_(switches) {}
  std::string description() const override { return inner_->description() + ", with faults"; }
  Result<tracking::PoseSample> wait_pose(Duration timeout) override {
    if (gone_ || switches_.met(Injection::kTrackerGone)) {
      gone_ = true;  // final for this handle
      return fail(Errc::kDisconnected, "reading the tracker: it was unplugged");
    }
    if (copies_ > 0) {
      --copies_;
      return last_;
    }
    const Time deadline = clock_.now() + timeout;
    VENEER_ASSIGN(tracking::PoseSample sample, inner_->wait_pose(timeout));
    while (switches_.met(Injection::kTrackerSilent)) {
      VENEER_ASSIGN(sample, inner_->wait_pose(std::max(Duration{}, deadline - clock_.now())));
    }
    if (switches_.met(Injection::kTrackerNan))
      sample.world_from_body.translation.x() = std::numeric_limits<double>::quiet_NaN();
    if (switches_.met(Injection::kTrackerFuture)) sample.time += 10s;
    if (switches_.met(Injection::kTrackerPast)) sample.time -= 10s;
    if (switches_.met(Injection::kTrackerTeleport))
      sample.world_from_body.translation.y() += 3.0 * static_cast<double>(sample.sequence % 7);
    if (switches_.met(Injection::kTrackerFlood)) copies_ = 40;
    last_ = sample;
    return sample;
  }
  tracking::TrackerStatus status() const override { return inner_->status(); }

 private:
  std::unique_ptr<tracking::Tracker> inner_;
  Clock& clock_;
  Switches& switches_;
  tracking::PoseSample last_;
  int copies_ = 0;
  bool gone_ = false;
};

/// A display with a refresh, whose picture stays when its output is closed.
class FaultyOutput final : public projector::Output {
 public:
  FaultyOutput(Duration period, Switches& switches, Display& display, std::atomic<Clock*>& clock)
      : period_(period), switches_(switches), display_(display), clock_(clock) {}
  std::string description() const override { return "metered display, with faults"; }
  bool wants_pixels(std::uint64_t /*frame_number*/) const override { return true; }
  Status present(const projector::Frame& frame) override {
    if (switches_.met(Injection::kOutputUnavailable))
      return fail(Errc::kUnavailable, "showing a frame: the cable is not plugged in");
    if (broken_ || switches_.met(Injection::kOutputIo) ||
        switches_.met(Injection::kOutputRefusesToOpen)) {
      broken_ = true;
      return fail(Errc::kIo, "showing a frame: the display's engine does not answer");
    }
    Clock& clock = *clock_.load();
    if (switches_.met(Injection::kOutputSlow)) clock.sleep_until(clock.now() + kSlow);
    display_.show(frame, clock.now());
    presented_ = {frame.number, clock.now()};
    return {};
  }
  Status blank() override {
    if (broken_) return fail(Errc::kIo, "blanking: the display's engine does not answer");
    display_.go_dark();
    return {};
  }
  std::optional<projector::Presented> last_presented() override {
    if (!presented_ || !switches_.met(Injection::kOutputLies)) return presented_;
    projector::Presented wrong = *presented_;
    wrong.time += wrong.number % 2 == 0 ? Duration(1h) : Duration(-1h);
    if (wrong.number % 3 == 0) wrong.number += 1'000'000;
    return wrong;
  }
  std::optional<Duration> refresh_period() const override { return period_; }

 private:
  Duration period_;
  Switches& switches_;
  Display& display_;
  std::atomic<Clock*>& clock_;
  std::optional<projector::Presented> presented_;
  bool broken_ = false;
};

/// Once lost, what it gives is as bright as can be: nobody may show it.
class FaultyRenderer final : public render::Renderer {
 public:
  FaultyRenderer(std::unique_ptr<render::Renderer> inner,
                 Switches& switches,
                 DrawLaws& laws,
                 std::atomic<Clock*>& clock)
      : inner_(std::move(inner)), switches_(switches), laws_(laws), clock_(clock) {}
  void release() override { inner_->release(); }
  bool lost() override {
    if (switches_.met(Injection::kGpuLost)) lost_ = true;
    return lost_ || inner_->lost();
  }
  Status set_profile(const render::PreparedProfile& profile) override {
    return inner_->set_profile(profile);
  }
  void draw(const render::FrameInput& input) override {
    ++laws_.draws;
    laws_.specular_weight = input.specular_weight;
    if (!input.eye_in_world.allFinite() || !input.world_from_object.translation.allFinite() ||
        !input.world_from_object.rotation.coeffs().allFinite() ||
        !(input.specular_weight >= 0 && input.specular_weight <= 1)) {
      ++laws_.not_finite;
    }
    if (switches_.met(Injection::kGpuSlow)) {
      Clock& clock = *clock_.load();
      clock.sleep_until(clock.now() + kSlow);
    }
    inner_->draw(input);
  }
  void draw_to_scanout(std::size_t buffer) override { inner_->draw_to_scanout(buffer); }
  void read_codes(ImageView<Rgb16> codes) override {
    inner_->read_codes(codes);
    if (switches_.met(Injection::kGpuLostInAFrame)) lost_ = true;
    if (lost_) {
      for (int y = 0; y < codes.height(); ++y)
        for (int x = 0; x < codes.width(); ++x) codes(x, y) = {255, 255, 255};
    }
  }
  void read_target(ImageView<Rgb32f> target_xyz) override { inner_->read_target(target_xyz); }
  void finish() override { inner_->finish(); }
  render::FrameStatistics statistics() override { return inner_->statistics(); }
  std::string description() const override { return inner_->description(); }

 private:
  std::unique_ptr<render::Renderer> inner_;
  Switches& switches_;
  DrawLaws& laws_;
  std::atomic<Clock*>& clock_;
  bool lost_ = false;
};

class FaultyControl final : public projector::ProjectorControl {
 public:
  explicit FaultyControl(Switches& switches) : switches_(switches) {}
  std::string description() const override { return "a projector, with faults"; }
  Result<projector::ProjectorState> read_state() override {
    if (switches_.met(Injection::kProjectorSilent))
      return fail(Errc::kNotFound, "asking the projector: nobody answers");
    if (switches_.met(Injection::kProjectorSlow)) std::this_thread::sleep_for(1500ms);
    projector::ProjectorState state;
    state.power = projector::Power::kOn;
    state.degamma = false;
    state.led_levels = projector::LedLevels{100, 100, 100};
    if (switches_.met(Injection::kProjectorChanged)) state.degamma = true;
    return state;
  }
  Status power(bool /*on*/) override { return {}; }
  Status mute(bool /*on*/) override { return {}; }
  Status freeze(bool /*on*/) override { return {}; }
  Status select_input(const std::string& /*input*/) override { return {}; }

 private:
  Switches& switches_;
};

}  // namespace

daemon::Devices faulty_devices(const std::filesystem::path& config,
                               double frame_rate_hz,
                               Switches& switches,
                               Display& display,
                               DrawLaws& laws,
                               std::atomic<Clock*>& clock) {
  daemon::Devices devices;
  devices.open_tracker =
      [&switches, &clock, config](Clock& of_daemon) -> Result<std::unique_ptr<tracking::Tracker>> {
    clock = &of_daemon;
    if (switches.met(Injection::kTrackerGone))
      return fail(Errc::kNotFound, "opening the tracker: it is not plugged in");
    VENEER_ASSIGN(TomlReader toml, TomlReader::open(config));
    TomlReader table = toml.table("tracker");
    VENEER_ASSIGN(auto inner, tracking::open_tracker(table, of_daemon));
    return std::make_unique<FaultyTracker>(std::move(inner), of_daemon, switches);
  };
  devices.open_output =
      [=, &switches, &display, &clock]() -> Result<std::unique_ptr<projector::Output>> {
    if (switches.met(Injection::kOutputRefusesToOpen))
      return fail(Errc::kUnavailable, "opening the display: another program has it");
    return std::make_unique<FaultyOutput>(
        from_seconds(1 / frame_rate_hz), switches, display, clock);
  };
  devices.open_control =
      [&switches, &laws](Clock& /*clock*/) -> Result<std::unique_ptr<projector::ProjectorControl>> {
    laws.control_opened = true;
    return std::make_unique<FaultyControl>(switches);
  };
  devices.make_renderer = [&switches, &laws, &clock](
                              const render::Scene& scene,
                              std::span<const render::Level> levels,
                              const calibration::ProjectorProfile& profile,
                              const render::RendererOptions& options,
                              const Scanout* scanout) -> Result<std::unique_ptr<render::Renderer>> {
    if (switches.met(Injection::kGpuRefusesToOpen))
      return fail(Errc::kUnavailable, "opening the GPU: its driver is being loaded");
    VENEER_ASSIGN(auto inner, render::Renderer::create(scene, levels, profile, options, scanout));
    ++laws.renderers;
    return std::make_unique<FaultyRenderer>(std::move(inner), switches, laws, clock);
  };
  devices.memory_pressure = [&switches]() -> Result<double> {
    return switches.met(Injection::kMemoryShort) ? 0.5 : 0.0;
  };
  return devices;
}

}  // namespace veneer::soak
