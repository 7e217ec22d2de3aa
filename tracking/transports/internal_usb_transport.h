// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libusb-1.0/libusb.h>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/unique_handle.h"
#include "tracking/transports/usb_bulk.h"

namespace veneer::tracking {

/// The open device. All of libusb's work is done by the thread that calls, inside of the calls.
class UsbTransport final : public Transport {
 public:
  /// Takes over interface 0, also from a kernel driver. Errors: as Port::open().
  [[nodiscard]] static Result<std::unique_ptr<UsbTransport>> open(const std::string& name,
                                                                  const BusDevice& device,
                                                                  const UsbModel& model,
                                                                  Clock& clock);
  ~UsbTransport() override;
  UsbTransport(const UsbTransport&) = delete;
  UsbTransport& operator=(const UsbTransport&) = delete;

  [[nodiscard]] Received read(std::span<std::byte> buffer, Time deadline) override;
  [[nodiscard]] IoStatus write(std::span<const std::byte> bytes, Time deadline) override;
  [[nodiscard]] IoStatus clear_stall() override;

 private:
  static constexpr std::size_t kTransferBytes = 512;  // the packet of high-speed bulk
  static constexpr std::size_t kInFlight = 4;
  /// What is kept while nobody reads; beyond that the device has to wait.
  static constexpr std::size_t kBacklog = 64;

  /// A transfer, and whether the kernel has it.
  struct Transfer {
    UsbTransport* owner = nullptr;
    libusb_transfer* usb = nullptr;
    bool in_flight = false;
    std::vector<unsigned char> buffer;
  };
  struct Message {
    IoStatus status = IoStatus::kOk;
    Time arrival;
    std::size_t size = 0;
    std::array<unsigned char, kTransferBytes> bytes;
  };

  explicit UsbTransport(Clock& clock) : clock_(clock) {}
  [[nodiscard]] int claim(const BusDevice& device);
  [[nodiscard]] int prepare_transfers(const UsbModel& model);
  [[nodiscard]] UsbModel described_endpoints() const;
  void add_transfer(const UsbPipe& pipe);

  static void LIBUSB_CALL on_transfer(libusb_transfer* usb);
  void on_received(Transfer& transfer);
  void push(IoStatus status);
  [[nodiscard]] IoStatus submit(Transfer& transfer);
  /// Submits what is not in flight; returns how the last failure ended, or kOk.
  [[nodiscard]] IoStatus submit_idle();
  void handle_events(Time until);
  void cancel_all();
  /// Waits for all transfers to come back; a moment at most.
  void collect();
  [[nodiscard]] bool any_in_flight() const;

  Clock& clock_;
  UniqueFd node_;
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
  std::vector<std::unique_ptr<Transfer>> in_;  // libusb keeps their addresses
  Transfer out_;
  std::deque<Message> messages_;
  bool claimed_ = false;
  bool closing_ = false;
  bool gone_ = false;
};

}  // namespace veneer::tracking
