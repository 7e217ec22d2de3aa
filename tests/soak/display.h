// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>

#include "base/clock.h"
#include "projector/output.h"
#include "tests/soak/light_meter.h"

namespace veneer::soak {

/// What the audience sees: the last picture that reached the projector, through whichever output.
/// Any thread.
class Display {
 public:
  Display(LightMeter meter, double ceiling_nits)
      : meter_(std::move(meter)), other_(meter_), ceiling_nits_(ceiling_nits) {}

  /// From now on codes may mean what either of both meters says; the lower reading counts.
  void allow(const LightMeter& other) {
    const std::lock_guard lock(mutex_);
    other_ = other;
  }
  /// From now on they mean this.
  void use(const LightMeter& meter) {
    const std::lock_guard lock(mutex_);
    meter_ = meter;
    other_ = meter;
  }

  void show(const projector::Frame& frame, Time now) {
    const std::lock_guard lock(mutex_);
    ++frames_;
    number_ = frame.number;
    shown_at_ = now;
    lit_ = LightMeter::lit(frame.codes);
    nits_ = std::min(meter_.brightest(frame.codes), other_.brightest(frame.codes));
    brightest_nits_ = std::max(brightest_nits_, nits_);
    if (nits_ <= ceiling_nits_ * (1 + kRounding)) return;
    ++too_bright_;
    if (first_too_bright_.empty())
      first_too_bright_ = fmt::format("frame {} sends {} cd/m^2", frame.number, nits_);
  }
  void go_dark() {
    const std::lock_guard lock(mutex_);
    lit_ = 0;
    nits_ = 0;
  }

  struct Picture {
    std::uint64_t frames = 0;  ///< that came through since the start
    std::uint64_t number = 0;
    Time shown_at;
    int lit = 0;  ///< pixels
    double nits = 0;
    double brightest_nits = 0;  ///< of all
    std::uint64_t too_bright = 0;
    std::string first_too_bright;
  };
  [[nodiscard]] Picture picture() const {
    const std::lock_guard lock(mutex_);
    return {
        frames_, number_, shown_at_, lit_, nits_, brightest_nits_, too_bright_, first_too_bright_};
  }

 private:
  /// The ceiling is enforced in single precision.
  static constexpr double kRounding = 1e-5;

  mutable std::mutex mutex_;
  LightMeter meter_;
  LightMeter other_;
  double ceiling_nits_;
  std::uint64_t frames_ = 0;
  std::uint64_t number_ = 0;
  Time shown_at_;
  int lit_ = 0;
  double nits_ = 0;
  double brightest_nits_ = 0;
  std::uint64_t too_bright_ = 0;
  std::string first_too_bright_;
};

}  // namespace veneer::soak
