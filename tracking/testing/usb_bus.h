// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tracking/testing/mock_usb.h"
#include "tracking/transports/usb_bulk.h"

// The real libusb on a mocked bus. Times here are real, so that limits on them are loose.
namespace veneer::tracking {

/// Opens a mocked LIBERTY and reads it.
class UsbBus : public ::testing::Test {
 protected:
  static constexpr std::uint8_t kOut = 0x04;
  static constexpr std::uint8_t kIn = 0x88;
  static constexpr std::size_t kInFlight = 4;
  static inline const UsbModel kModel{
      "LIBERTY", {0x0f44, 0xff20}, 0xff21, kOut, {{{kIn, UsbPipe::Kind::kBulk}}}};

  static mock::UsbDescription description(std::string serial = "A1", std::string usb_port = "1-1") {
    return {0x0f44, 0xff20, "LIBERTY", std::move(serial), std::move(usb_port), {{kOut}, {kIn}}};
  }
  static mock::Bytes bytes_of(std::size_t size, int first = 0) {
    mock::Bytes bytes(size);
    for (std::size_t i = 0; i < size; ++i)
      bytes[i] = static_cast<std::byte>(first + static_cast<int>(i));
    return bytes;
  }

  UsbBulkPort port(UsbIdentity identity = {}) {
    return UsbBulkPort("LIBERTY", {kModel}, std::move(identity), clock_);
  }
  std::unique_ptr<Transport> open(Port& port) {
    auto transport = port.open();
    EXPECT_TRUE(transport) << transport.error().what;
    return transport ? *std::move(transport) : nullptr;
  }
  Time in(Duration duration) { return clock_.now() + duration; }
  IoStatus read_status(Transport& transport, Duration patience = std::chrono::seconds(2)) {
    return transport.read(buffer_, in(patience)).status;
  }
  /// The bytes of the next message, empty on any failure.
  mock::Bytes read_bytes(Transport& transport, Duration patience = std::chrono::seconds(2)) {
    const Received received = transport.read(buffer_, in(patience));
    return {buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(received.bytes)};
  }

  SteadyClock clock_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(Transport::kLargestMessage);
};

}  // namespace veneer::tracking
