// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/result.h"
#include "tracking/pose.h"

namespace veneer::tracking {

struct PredictionOptions {
  /// Up to here velocities are taken as constant. 0 to 0.2.
  double horizon_s = 0.05;
  /// Beyond the horizon they decay with this time constant. > 0.
  double decay_s = 0.03;
  /// Velocities come from the samples of this span of time. > 0, at most 0.1.
  double velocity_window_s = 0.03;
  [[nodiscard]] Status check() const;
};

/// The recent poses of one body. One thread adds, any others ask: the newest samples lie in a ring
/// whose slots carry sequence numbers, so that asking never waits, locks or spins, not even on a
/// writer that was interrupted half way through a slot.
class PoseTrack {
 public:
  /// @param options  checked by the caller.
  explicit PoseTrack(const PredictionOptions& options);

  /// What add() did with a sample.
  enum class Verdict {
    kTaken,
    kDuplicate,  ///< has the sequence number of the newest one
    kLate,       ///< is not after the newest one
    kInvalid,    ///< not finite, farther out than 1000 km, or no rotation
  };
  /// Takes a sample whose pose is finite, whose quaternion is of unit length within 10 % (it is
  /// normalised) and whose time is after the newest one; drops any other.
  Verdict add(const PoseSample& sample);

  /// The pose at `when`: interpolated within the history (the oldest known pose, as kHeld, before
  /// it), predicted beyond it from the newest sample at constant velocity and angular rate up to
  /// the horizon and at decaying ones after that; kHeld once less than 5 % of them is left.
  ///
  /// Velocities are those of the straight line of least squares through the samples of the velocity
  /// window, but through at least two samples where the second is at most 0.2 s older; zero where
  /// there is but one sample or they span less than 0.5 ms. The 1024 newest samples are kept: all
  /// of any window up to 10 kHz; of a faster tracker the window is what these span. Velocities and
  /// interpolation never reach from one epoch into another: up to the first sample of the later
  /// epoch the last pose of the earlier one is held. Within an epoch position and rotation are
  /// continuous in `when`. Never NaN. No allocation, no lock, no system call.
  [[nodiscard]] PoseEstimate at(Time when) const;

 private:
  struct Rates {
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
  };
  struct TimedPose {
    Time time;
    RigidTransform world_from_body;
    std::uint32_t epoch = 0;
    Rates rates;  // found once, by the adding thread, so that asking is quick
  };
  /// 4.3 s at 240 Hz, 0.102 s at the 10 kHz of the fastest simulated tracker: longer than any
  /// velocity window.
  static constexpr std::size_t kSlots = 1024;
  static constexpr std::size_t kNumbers = 13;          // position, quaternion, velocities
  static constexpr std::size_t kWords = kNumbers + 2;  // and time, epoch
  struct Slot {
    /// 2 n + 1 while sample n is being written, 2 n + 2 once it is there.
    std::atomic<std::uint64_t> stamp{0};
    std::array<std::atomic<std::uint64_t>, kWords> words{};
  };

  void publish(const TimedPose& pose);
  /// Sample number `index`, unless the ring has gone over it.
  [[nodiscard]] std::optional<TimedPose> read(std::uint64_t index) const;
  /// @param index  number of the sample `newest`; `when` is before it.
  [[nodiscard]] PoseEstimate interpolate(Time when,
                                         const TimedPose& newest,
                                         std::uint64_t index) const;
  /// The same for `when` not before `newest`.
  [[nodiscard]] PoseEstimate predict(Time when, const TimedPose& newest) const;
  /// Of a sample that is about to be number `index`.
  [[nodiscard]] Rates fit_rates(const TimedPose& newest, std::uint64_t index) const;

  PredictionOptions options_;
  std::array<Slot, kSlots> slots_;
  std::atomic<std::uint64_t> published_{0};  // how many samples were ever taken
  PoseSample newest_;                        // the adding thread's own copy
};

}  // namespace veneer::tracking
