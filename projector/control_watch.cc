// SPDX-License-Identifier: Apache-2.0
#include "projector/control_watch.h"

#include <algorithm>
#include <utility>

namespace veneer::projector {
namespace {

constexpr double kLeastPeriod_s = 1;
constexpr double kLeastPeriodOverNetwork_s = 10;
constexpr double kMostPeriod_s = 3600;

void compare(ControlReport& report, const ControlRecord& kept) {
  if (!report.state) return;
  report.changes = differences(kept, to_record(*report.state));
  report.warnings = warnings(*report.state, kept);
}

ControlReport report_of(const ProjectorState& state,
                        const std::string& description,
                        const ControlRecord& kept) {
  ControlReport report;
  report.asked = true;
  report.reachable = true;
  report.text = description + ": " + summary_of(state);
  report.state = state;
  report.read = SteadyClock{}.now();
  compare(report, kept);
  return report;
}

}  // namespace

ControlWatchOptions ControlWatchOptions::read(TomlReader& control_table) {
  ControlWatchOptions options;
  std::string driver;
  control_table.read("driver", driver);
  double poll_s = to_seconds(options.period);
  control_table.read("poll_s", poll_s);
  const bool over_network = driver == "pjlink";
  const double least = over_network ? kLeastPeriodOverNetwork_s : kLeastPeriod_s;
  // Compared so that NaN is refused too.
  if (!(poll_s >= least && poll_s <= kMostPeriod_s)) {
    control_table.add_error(
        "poll_s",
        fmt::format(
            "is {} s; set it from {} to {}{}",
            poll_s,
            least,
            kMostPeriod_s,
            over_network ? " (projectors on the network mind being asked more often)" : ""));
    return options;
  }
  options.period = from_seconds(poll_s);
  return options;
}

Status ControlWatchOptions::check() const {
  if (period > Duration{0} && first_pause > Duration{0} && longest_pause >= first_pause) return {};
  return fail(Errc::kInvalidOption,
              "watching the projector: its period and its pauses must be above 0, and the longest "
              "pause no shorter than the first");
}

ControlReport look_at(ProjectorControl& control, const ControlRecord& kept) {
  const Result<ProjectorState> state = control.read_state();
  ControlReport report;
  if (state) {
    report = report_of(*state, control.description(), kept);
  } else {
    report.asked = true;
    report.failures = 1;
    report.text = state.error().what;
  }
  return report;
}

ControlWatch::ControlWatch(Open open, const ControlRecord& kept, const ControlWatchOptions& options)
    : open_(std::move(open)), options_(options), kept_(kept) {
  VENEER_CHECK(open_ && options.check());
  report_.text = "the projector has not been asked yet";
  thread_ = std::thread([this] { watch(); });
}

ControlWatch::~ControlWatch() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    if (asked_ != nullptr) asked_->interrupt();
  }
  stopped_.notify_all();
  thread_.join();
}

ControlReport ControlWatch::report() const {
  const std::lock_guard lock(mutex_);
  return report_;
}

void ControlWatch::keep(const ControlRecord& kept) {
  const std::lock_guard lock(mutex_);
  kept_ = kept;
  compare(report_, kept_);
}

void ControlWatch::watch() {
  while (true) {
    std::string description;
    const Result<ProjectorState> state = ask(description);
    std::unique_lock lock(mutex_);
    if (stopping_) return;  // what was interrupted is no failure
    lock.unlock();
    if (state) {
      tell(*state, description);
    } else {
      tell(state.error());
    }
    lock.lock();
    if (stopped_.wait_for(lock, pause(), [this] { return stopping_; })) return;
  }
}

Result<ProjectorState> ControlWatch::ask(std::string& description) {
  VENEER_ASSIGN(const std::unique_ptr<ProjectorControl> control, open_());
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return fail(Errc::kCancelled, "watching the projector: stopped");
    asked_ = control.get();
  }
  Result<ProjectorState> state = control->read_state();
  {
    const std::lock_guard lock(mutex_);
    asked_ = nullptr;
  }
  description = control->description();
  return state;
}

Duration ControlWatch::pause() const {
  if (report_.failures == 0) return options_.period;
  constexpr int kMostDoublings = 20;  // beyond any longest pause, and far from overflow
  const int doublings = std::min(report_.failures - 1, kMostDoublings);
  return std::min(options_.first_pause * (std::int64_t{1} << doublings), options_.longest_pause);
}

void ControlWatch::tell(const ProjectorState& state, const std::string& description) {
  const std::lock_guard lock(mutex_);
  report_ = report_of(state, description, kept_);
}

void ControlWatch::tell(const Error& error) {
  const std::lock_guard lock(mutex_);
  report_.asked = true;
  report_.reachable = false;
  report_.text = error.what;
  ++report_.failures;
}

std::string summary_of(const ProjectorState& state) {
  std::string text = state.power == Power::kUnknown ? "" : std::string(name_of(state.power));
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : ", ") + part; };
  if (state.input) add("input " + *state.input);
  if (state.muted == true) add("blanked");
  if (state.frozen == true) add("frozen");
  if (state.locked == false) add("no signal");
  for (const Lamp& lamp : state.lamps.value_or(std::vector<Lamp>{}))
    add(fmt::format("lamp {} h{}", lamp.hours, lamp.on ? "" : " (off)"));
  if (state.led_levels) {
    const LedLevels& led = *state.led_levels;
    add(fmt::format("LEDs {} {} {}", led[0], led[1], led[2]));
  }
  for (const auto& [part, health] : state.health)
    if (health != Health::kOk) add(fmt::format("{} {}", part, name_of(health)));
  return text.empty() ? "it tells nothing of itself" : text;
}

}  // namespace veneer::projector
