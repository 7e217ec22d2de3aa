// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/clock.h"

namespace veneer::tracking {

/// What a device says of one measurement, before anything was checked against anything.
struct RawSample {
  int sensor = 0;                         ///< as the device numbers them
  std::optional<std::uint64_t> ticks;     ///< of the device's clock
  std::optional<std::uint64_t> sequence;  ///< of this sensor's samples
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  bool suspect = false;  ///< the device itself is not sure of it
};

/// A counter that wraps round.
struct WrappingCounter {
  int bits = 64;  ///< 1 to 64
};

/// A device's clock.
struct DeviceClock {
  WrappingCounter counter;
  double seconds_per_tick = 0;  ///< > 0
};

/// Something to be sent to a device, and how long to leave it in peace after that; what it says
/// meanwhile is dropped.
struct Command {
  enum class Kind { kWrite, kFeature };
  Kind kind = Kind::kWrite;
  std::vector<std::byte> bytes;
  Duration pause{};
};

/// What is done with a device that has fallen silent.
enum class Recovery {
  kTellAgain,  ///< it begins anew with restart(); opened again when not a byte comes
  kAsk,        ///< restart() goes into the conversation as it is; likewise
  kListen,     ///< nothing: nobody can be told, and what is open stays open
};

struct ProtocolCounters {
  std::uint64_t skipped_bytes = 0;  ///< that belong to no frame
  std::uint64_t bad_frames = 0;     ///< of a wrong size, checksum, station or version
};

/// What the bytes of a device mean. Pure: it does no input or output and asks for no time, so that
/// it can be fuzzed, and any way to cut the same bytes into pieces gives the same samples (where
/// the transport is a byte stream; reports and datagrams come whole).
class Protocol {
 public:
  virtual ~Protocol() = default;
  /// Makes the device send, whatever it did before; sent after every opening.
  [[nodiscard]] virtual std::vector<Command> start() const = 0;
  [[nodiscard]] virtual Recovery recovery() const { return Recovery::kTellAgain; }
  /// Sent when it has fallen silent, but for kListen.
  [[nodiscard]] virtual std::vector<Command> restart() const { return start(); }
  /// What the ticks of its samples are; nothing where they have none.
  [[nodiscard]] virtual std::optional<DeviceClock> clock() const = 0;
  /// What the sequence numbers of its samples are; nothing where they have none.
  [[nodiscard]] virtual std::optional<WrappingCounter> sequence() const = 0;
  /// Between two samples of one sensor, as a rule.
  [[nodiscard]] virtual Duration period() const = 0;
  /// Forgets what was begun; the counters stay.
  virtual void reset() = 0;
  /// Takes what arrived, appends the samples that are complete with it to `samples` and what the
  /// device wants to be answered to `reply`.
  virtual void feed(std::span<const std::byte> bytes,
                    std::vector<RawSample>& samples,
                    std::vector<std::byte>& reply) = 0;
  /// Whether the device has forgotten what it was told and must be started again (it answers in
  /// text where binary was agreed on, it has lost its mode) or has refused to work with us. Where
  /// recovery() is not kTellAgain, it is opened again instead. feed() sets it, reset() clears it.
  [[nodiscard]] virtual bool wants_restart() const { return false; }
  [[nodiscard]] virtual ProtocolCounters counters() const = 0;
};

}  // namespace veneer::tracking
