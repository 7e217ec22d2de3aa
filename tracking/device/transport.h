// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "base/clock.h"
#include "base/result.h"

namespace veneer::tracking {

/// How a read or write ended.
enum class IoStatus {
  kOk,
  kTimeout,   ///< nothing until the deadline; try again
  kStall,     ///< the endpoint is halted; clear_stall() may free it
  kOverflow,  ///< the device sent more than was asked for
  kIo,        ///< a transfer failed; the next may not
  kGone,      ///< final: unplugged, or the peer has closed
};

struct Received {
  IoStatus status = IoStatus::kTimeout;
  std::size_t bytes = 0;  ///< of the buffer that were filled; 0 unless kOk
  Time arrival;           ///< when they arrived, as near to the wire as is known
};

/// An open connection to a device: bytes in, bytes out, nothing of what they mean. Closes when it
/// goes. One thread uses it at a time; it starts none.
class Transport {
 public:
  virtual ~Transport() = default;
  /// Waits until `deadline` at most for one message: a USB transfer, a HID report, a datagram, or
  /// what a byte stream has. What came before the call is there at once.
  /// @param buffer  at least kLargestMessage bytes.
  [[nodiscard]] virtual Received read(std::span<std::byte> buffer, Time deadline) = 0;
  /// Sends all of `bytes`, or fails.
  [[nodiscard]] virtual IoStatus write(std::span<const std::byte> bytes, Time deadline) = 0;
  /// Sends a HID feature report whose first byte is the report number; kIo where there is no such
  /// thing.
  [[nodiscard]] virtual IoStatus send_feature(std::span<const std::byte>) { return IoStatus::kIo; }
  [[nodiscard]] virtual IoStatus clear_stall() { return IoStatus::kIo; }

  static constexpr std::size_t kLargestMessage = 2048;
};

/// Where a device is plugged in, or listens: opens it, again and again if need be.
class Port {
 public:
  virtual ~Port() = default;
  /// Which device is meant: "LIBERTY 0f44:ff20, serial number 1234".
  [[nodiscard]] virtual std::string description() const = 0;
  /// Takes no longer than some tens of milliseconds.
  /// Errors: kNotFound (it is not there), kUnavailable (it is there but may not be opened, is held
  /// by another program or lacks its firmware; the text says the remedy), kIo.
  [[nodiscard]] virtual Result<std::unique_ptr<Transport>> open() = 0;
  /// Waits until `deadline`, or until something was plugged in that may be the device: then true.
  [[nodiscard]] virtual bool wait_for_arrival(Time deadline) = 0;
};

}  // namespace veneer::tracking
