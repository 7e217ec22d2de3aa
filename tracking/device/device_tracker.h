// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/random.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/device/clock_mapper.h"
#include "tracking/device/protocol.h"
#include "tracking/device/transport.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// Keys of the [tracker] table that every device has.
struct DeviceTrackerOptions {
  /// From the moment of measurement to the arrival of a sample. 0 to 1000.
  double latency_ms = 0;
  /// Reads the keys and records what is out of range.
  [[nodiscard]] static DeviceTrackerOptions read(TomlReader& toml);
};

/// A tracker that is a device: a port, and a protocol that says what comes out of it. Opens the
/// device, starts it, matches its clock to ours, and begins again whenever it is unplugged, falls
/// silent or fails. It never gives up, never blocks for longer than asked, and all happens on the
/// thread that calls wait_pose().
///
/// Sample times are the device's, mapped to our clock (ClockMapper), or the arrival where it has
/// no clock or its clock stands still; less the latency. While the clock is not locked every sample
/// is an epoch of its own, so that nobody makes velocities of it.
class DeviceTracker final : public Tracker {
 public:
  /// Opens nothing yet: wait_pose() does.
  /// @param clock  borrowed; must outlive the tracker.
  DeviceTracker(std::unique_ptr<Port> port,
                std::unique_ptr<Protocol> protocol,
                const DeviceTrackerOptions& options,
                Clock& clock);

  [[nodiscard]] std::string description() const override;
  /// As Tracker says; never kDisconnected.
  [[nodiscard]] Result<PoseSample> wait_pose(Duration timeout) override;
  [[nodiscard]] TrackerStatus status() const override;

 private:
  /// What is known of one sensor since the last (re)start.
  struct Sensor {
    std::uint64_t sent = 0;  // sequence number of the newest sample handed out; through restarts
    std::optional<std::int64_t> sequence;  // of the device, unwrapped
    std::optional<std::uint64_t> ticks;
    std::optional<Time> newest;
    int equal_ticks = 0;  // samples in a row that had the ticks of the one before
  };

  /// Does the next thing; waits until `deadline` at most.
  void step(Time deadline);
  void try_to_open(Time deadline);
  void initialise(Time deadline);
  void receive(Time deadline);
  void on_silence(Time now);
  void start(std::vector<Command> commands, TrackerState state, std::string detail);
  /// All commands are sent.
  void on_started();
  void take_bytes(std::span<const std::byte> bytes, Time arrival);
  void take_sample(const RawSample& raw, Time arrival);
  /// When it was measured, less the latency; nothing where it is to be dropped, which is counted.
  [[nodiscard]] std::optional<Time> time_of(const RawSample& raw, Sensor& sensor, Time arrival);
  /// How far its sequence number is from that of the sample before: 1 where there is none.
  [[nodiscard]] std::uint64_t step_of(const RawSample& raw, Sensor& sensor) const;
  void on_error(IoStatus status);
  void on_error_while_starting(IoStatus status, Time deadline);
  /// Closes the device; it is opened again after a while, or when something is plugged in.
  void close(TrackerState state, std::string detail);
  void begin_epoch();
  void set_state(TrackerState state, std::string detail);
  template <class Change>
  void count(Change change);

  const std::unique_ptr<Port> port_;
  const std::unique_ptr<Protocol> protocol_;
  const DeviceTrackerOptions options_;
  Clock& clock_;
  std::optional<ClockMapper> mapper_;
  std::unique_ptr<Transport> transport_;
  std::vector<std::byte> buffer_;
  std::vector<RawSample> raw_;      // of one message
  std::vector<std::byte> reply_;    // to it
  std::deque<PoseSample> samples_;  // not handed out yet
  std::map<int, Sensor> sensors_;
  std::uint32_t epoch_ = 0;

  std::vector<Command> commands_;  // to be sent
  std::size_t next_command_ = 0;
  Time pause_until_;
  Time newest_bytes_;   // when they arrived, or when it was started
  Time newest_sample_;  // likewise
  Time newest_restart_;
  Time retry_at_;
  Duration backoff_;
  Pcg32 random_{1};  // spreads the attempts to open
  int errors_in_a_row_ = 0;
  Time first_error_;
  bool stall_cleared_ = false;

  mutable std::mutex status_mutex_;
  TrackerStatus status_;
  ProtocolCounters seen_;  // of the protocol, as far as they are in status_
};

}  // namespace veneer::tracking
