// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "base/clock.h"
#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// The number nearest to `last` that ends in the bits of `raw`: unwraps a counter. Without `last`,
/// the bits themselves.
[[nodiscard]] std::int64_t widen(WrappingCounter counter,
                                 std::uint64_t raw,
                                 std::optional<std::int64_t> last);

/// The least delayed sample of half a second.
struct ClockBin {
  std::int64_t number = -1;  ///< of the bin, counted in time of the device; -1: none yet
  double device_s = 0;       ///< time of the device
  double offset_s = 0;       ///< arrival - device time
};

/// When a sample was measured, on our clock, from the device's own clock and the moments at which
/// its samples arrived.
///
/// A sample may arrive late but never early. So the offset between the clocks is the lower envelope
/// of (arrival - device time) over the last four seconds: delays, however long, lie above it and
/// move nothing. The envelope is a line whose slope is the difference in rate of the clocks, at
/// most 500 ppm: the line under the minima of eight bins that is nearest to them. Once locked, the
/// offset slews at 200 us a second at most (plus that slope), so that times of measurement never
/// jump. Source: Moon, Skelly and Towsley 1999, "Estimation and Removal of Clock Skew from Network
/// Delay Measurements", the linear programme of section IV, there over all delays.
class ClockMapper {
 public:
  explicit ClockMapper(const DeviceClock& clock);

  enum class Verdict {
    kMapped,
    /// The device's clock has begun anew (twice in a row its time did not fit the arrival): time
    /// and everything learnt of it start here.
    kRestarted,
    /// The device's time does not fit the arrival; not used, no time is given.
    kOutlier,
  };
  struct Mapped {
    Verdict verdict = Verdict::kMapped;
    Time time;            ///< of measurement plus the shortest delay; never after the arrival
    bool locked = false;  ///< whether earlier times are to be compared with it
  };
  /// @param ticks    of the device; many samples may have the same.
  /// @param arrival  not before that of the sample before.
  [[nodiscard]] Mapped map(std::uint64_t ticks, Time arrival);
  /// Forgets everything: the device was opened again.
  void reset();

  /// Difference in rate as it is known now: seconds of ours a second of the device, less 1.
  [[nodiscard]] double skew() const { return skew_; }
  [[nodiscard]] bool locked() const { return locked_; }

 private:
  static constexpr std::size_t kBins = 8;
  static constexpr int kRun = 8;  // samples a run, while not locked
  static constexpr std::size_t kRuns = 4;
  /// Whether a sample cannot be of the clock that is known.
  [[nodiscard]] bool misfits(double device_s, double offset_s) const;
  void learn(double device_s, double offset_s);
  void fit_envelope();
  void try_to_lock(double offset_s);
  /// The envelope at a time of the device.
  [[nodiscard]] double envelope(double device_s) const;

  DeviceClock clock_;
  std::optional<std::int64_t> first_ticks_;
  std::optional<std::int64_t> newest_ticks_;
  Time first_arrival_;
  double newest_device_s_ = 0;              // time of the device since its first tick
  std::optional<double> outlier_device_s_;  // of the sample before, if it was one
  Time outlier_arrival_;
  std::array<ClockBin, kBins> bins_;
  double skew_ = 0;
  double base_s_ = 0;        // the envelope is base + skew * device_s
  double applied_s_ = 0;     // the offset that is used, and that slews
  double applied_at_s_ = 0;  // the device's time of it
  bool locked_ = false;
  int run_samples_ = 0;
  double run_minimum_s_ = 0;
  std::array<double, kRuns> run_minima_{};
  std::size_t runs_ = 0;
};

}  // namespace veneer::tracking
