// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "base/random.h"
#include "tracking/drivers/polhemus/polhemus_frame.h"
#include "tracking/testing/mock_usb.h"

namespace veneer::tracking::mock {

/// A Polhemus LIBERTY with one station on the mocked bus: obeys its commands and, when told to,
/// sends 240 frames a second of an eye that goes to and fro, counted by a clock of its own, which
/// begins at each plug.
class Liberty {
 public:
  static constexpr std::uint16_t kVendor = 0x0f44;
  static constexpr std::uint16_t kProduct = 0xff20;
  static constexpr std::uint16_t kBootProduct = 0xff21;
  static constexpr std::uint8_t kOut = 0x04;
  static constexpr std::uint8_t kIn = 0x88;

  explicit Liberty(std::string serial = "L1", std::string usb_port = "1-1");
  ~Liberty();

  void plug();
  void unplug();
  /// For faults of transfers; plug it here and not there.
  [[nodiscard]] UsbDevice& usb() { return usb_; }

  /// Whether it was told to send frames, and does.
  [[nodiscard]] bool streams() const { return streams_; }
  /// As after a brown-out: it sends nothing until it is told again.
  void forget() { streams_ = false; }
  /// It answers no write any more, or does again.
  void ignore_writes(bool ignore) { ignores_writes_ = ignore; }
  /// Times that it was told to send frames.
  [[nodiscard]] std::uint64_t starts() const { return starts_; }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  /// The newest frame that was sent, as it went over the wire.
  [[nodiscard]] Bytes newest_frame() const;

 private:
  int on_write(const Bytes& bytes);
  void run();

  UsbDevice usb_;
  std::atomic<bool> streams_{false};
  std::atomic<bool> ignores_writes_{false};
  std::atomic<std::uint64_t> starts_{0};
  std::atomic<std::uint64_t> frames_{0};
  mutable std::mutex mutex_;
  std::condition_variable ends_;
  bool ended_ = false;
  std::uint32_t count_ = 0;
  std::uint32_t sent_ = 0;  // the count when it last was
  std::thread thread_;
};

/// One random fault: garbage, frames that are cut short, doubled or changed, babble, stalls, errors
/// of the bus, silence, replugs, refusals. What ends a connection is rarer, since it is then waited
/// before the next attempt, and what comes meanwhile is no test.
void inject_random_fault(Pcg32& random, Liberty& liberty);

}  // namespace veneer::tracking::mock
