// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <string>

#include "tracking/testing/mock_bus.h"

namespace veneer::tracking::mock {

struct UsbEndpoint {
  std::uint8_t address = 0;
  bool interrupt = false;  ///< bulk otherwise
};

struct UsbDescription {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string name;
  std::string serial;  ///< empty: none
  std::string usb_port = "1-1";
  std::vector<UsbEndpoint> endpoints;
};

/// A device on the mocked bus, which the real libusb talks to. A test says what it sends and how
/// its transfers fail. Any thread may use it.
///
/// Some ten arrivals and departures that a program has asked to hear of and does not listen to make
/// umockdev end the test.
class UsbDevice {
 public:
  /// What on_write() returns for a transfer that the device never takes.
  static constexpr int kNeverDone = 1;
  /// How each written message ends: 0, an errno such as EPIPE (the device has stalled) or
  /// kNeverDone. Called on umockdev's thread; set it before plug().
  using OnWrite = std::function<int(std::uint8_t endpoint, const Bytes& bytes)>;

  explicit UsbDevice(UsbDescription description, OnWrite on_write = {});
  ~UsbDevice();
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;

  /// Every time under a new number below /dev.
  void plug();
  /// As it is pulled out: transfers in flight die, all later calls fail with ENODEV.
  void unplug();
  [[nodiscard]] bool is_plugged() const;
  /// For the next plug.
  void move_to(std::string usb_port) { description_.usb_port = std::move(usb_port); }
  [[nodiscard]] std::string node() const;

  /// One transfer comes in: into the oldest that waits, or the next that is submitted. Longer than
  /// the transfer's buffer is babble, as on a real host controller.
  void send(std::uint8_t endpoint, Bytes bytes);
  /// A transfer fails, with an errno: EPIPE (stall), EPROTO, ETIMEDOUT, EILSEQ...
  void fail_transfer(std::uint8_t endpoint, int error);
  /// Forgets what was sent and not fetched.
  void flush();

  /// Submitting fails this often, with that errno.
  void refuse_submits(int count, int error);
  /// Claiming the interface fails with that errno; 0: not.
  void refuse_claims(int error);
  /// Whoever is not root may not open it, until the next plug.
  void forbid_opening();
  /// A kernel driver holds the interface until somebody detaches it.
  void bind_kernel_driver(bool bound);

  [[nodiscard]] bool has_kernel_driver() const;
  /// Waits until that many reads are in flight; false after a second.
  [[nodiscard]] bool wait_for_reads_in_flight(std::size_t count);
  [[nodiscard]] std::size_t in_flight() const;
  /// Programs that have it open.
  [[nodiscard]] int openers() const;
  /// Waits until nobody has it open; false after a second. It must be so before the device goes.
  [[nodiscard]] bool wait_until_closed();
  /// Calls into the kernel so far.
  [[nodiscard]] std::uint64_t ioctls() const { return ioctls_; }
  /// Those of them that submitted a transfer.
  [[nodiscard]] std::uint64_t submits() const { return submits_; }
  /// Those that took one back.
  [[nodiscard]] std::uint64_t discards() const { return discards_; }
  [[nodiscard]] std::uint64_t cleared_halts() const { return cleared_halts_; }

 private:
  struct Transfer;
  struct Packet {
    std::uint8_t endpoint;
    int error;
    Bytes bytes;
  };
  struct Held;

  static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);
  static void on_connected(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);
  static void on_vanished(gpointer self, GObject* client);
  static gboolean on_held_too_long(gpointer held);

  // These are called with the lock held.
  int ioctl(UMockdevIoctlClient* client, unsigned long request);
  int submit(UMockdevIoctlClient* client);
  int discard(UMockdevIoctlClient* client);
  int control(UMockdevIoctlClient* client);
  void hold(UMockdevIoctlClient* client);
  void reap(UMockdevIoctlClient* client);
  void wake(UMockdevIoctlClient* client);
  void deliver(Packet packet);
  void finish(std::list<Transfer>::iterator transfer, int error, Bytes bytes);

  [[nodiscard]] std::string description_text() const;
  [[nodiscard]] std::string syspath() const;
  [[nodiscard]] Bytes descriptors() const;

  UsbDescription description_;
  OnWrite on_write_;
  UMockdevIoctlBase* handler_;
  int number_ = 0;  // below /dev/bus/usb/BUS/

  // Recursive, since letting go of a caller may be what ends it.
  mutable std::recursive_mutex mutex_;
  std::condition_variable_any changed_;
  bool plugged_ = false;
  bool attached_ = false;
  int openers_ = 0;
  int timers_ = 0;
  int refused_submits_ = 0;
  int submit_error_ = 0;
  int claim_error_ = 0;
  bool driver_bound_ = false;
  std::list<Transfer> pending_;
  std::list<Transfer> done_;
  std::deque<Packet> packets_;
  std::map<UMockdevIoctlClient*, Held*> held_;
  std::atomic<std::uint64_t> ioctls_{0};
  std::atomic<std::uint64_t> submits_{0};
  std::atomic<std::uint64_t> discards_{0};
  std::atomic<std::uint64_t> cleared_halts_{0};
};

}  // namespace veneer::tracking::mock
