// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/usb_bus.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

#include "tracking/testing/holdings.h"

// What goes over the wire of an open device, how it fails, and what is left of it after an unplug.
namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST_F(UsbBus, MessagesArriveWholeInOrderAndWithTheTimeOfTheirArrival) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(kInFlight));
  for (int i = 0; i < 40; ++i) {
    const Time before = clock_.now();
    device.send(kIn, bytes_of(48, i));
    const Received received = transport->read(buffer_, in(seconds(2)));
    ASSERT_EQ(received.status, IoStatus::kOk);
    ASSERT_EQ(received.bytes, 48U);
    EXPECT_EQ(buffer_[0], static_cast<std::byte>(i));
    EXPECT_GE(received.arrival, before);
    EXPECT_LE(received.arrival, clock_.now());
  }
}

TEST_F(UsbBus, WhatCameBeforeTheCallIsThereWithoutPatience) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  device.send(kIn, bytes_of(3));
  EXPECT_EQ(read_bytes(*transport, Duration{}), bytes_of(3));
  EXPECT_EQ(read_status(*transport, Duration{}), IoStatus::kTimeout);
}

TEST_F(UsbBus, ShortReadsLoseNothing) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  mock::Bytes sent;
  mock::Bytes received;
  for (int i = 0; i < 30; ++i) {
    for (const std::size_t size : {std::size_t{0},
                                   std::size_t{1},
                                   std::size_t{7},
                                   std::size_t{8},
                                   std::size_t{47},
                                   std::size_t{512}}) {
      const mock::Bytes bytes = bytes_of(size, i);
      sent.insert(sent.end(), bytes.begin(), bytes.end());
      device.send(kIn, bytes);
    }
  }
  while (received.size() < sent.size()) {
    const mock::Bytes bytes = read_bytes(*transport);
    ASSERT_FALSE(bytes.empty());  // empty packets are passed over
    received.insert(received.end(), bytes.begin(), bytes.end());
  }
  EXPECT_EQ(received, sent);
}

TEST_F(UsbBus, SilenceIsATimeoutAndCostsFewCalls) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  const std::uint64_t before = device.ioctls();
  for (int i = 0; i < 5; ++i) {
    const Time begin = clock_.now();
    EXPECT_EQ(read_status(*transport, milliseconds(100)), IoStatus::kTimeout);
    EXPECT_GE(clock_.now() - begin, milliseconds(99));
    EXPECT_LE(clock_.now() - begin, milliseconds(400));
  }
  // The mock lets libusb ask once in 2 ms, where a real bus would not let it ask at all.
  EXPECT_LE(device.ioctls() - before, 400U);
}

TEST_F(UsbBus, WritesArriveWholeOnTheirEndpoint) {
  std::mutex mutex;
  std::vector<mock::Bytes> written;
  mock::UsbDevice device(description(), [&](std::uint8_t endpoint, const mock::Bytes& bytes) {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(endpoint, kOut);
    written.push_back(bytes);
    return 0;
  });
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  EXPECT_EQ(transport->write(bytes_of(3), in(seconds(2))), IoStatus::kOk);
  EXPECT_EQ(transport->write(bytes_of(15), in(seconds(2))), IoStatus::kOk);
  const std::lock_guard lock(mutex);
  EXPECT_EQ(written, (std::vector{bytes_of(3), bytes_of(15)}));
}

TEST_F(UsbBus, AWriteThatTheDeviceNeverTakesTimesOutAndTheNextMayPass) {
  std::atomic<int> outcome = mock::UsbDevice::kNeverDone;
  mock::UsbDevice device(description(), [&](std::uint8_t, const mock::Bytes&) { return +outcome; });
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  const Time begin = clock_.now();
  EXPECT_EQ(transport->write(bytes_of(3), in(milliseconds(50))), IoStatus::kTimeout);
  EXPECT_GE(clock_.now() - begin, milliseconds(50));
  EXPECT_LE(clock_.now() - begin, milliseconds(300));
  outcome = EPIPE;
  EXPECT_EQ(transport->write(bytes_of(3), in(seconds(2))), IoStatus::kStall);
  outcome = 0;
  EXPECT_EQ(transport->write(bytes_of(3), in(seconds(2))), IoStatus::kOk);
  device.send(kIn, bytes_of(5));
  EXPECT_EQ(read_bytes(*transport), bytes_of(5));
}

struct Failure {
  const char* name;
  int error;
  IoStatus status;
};

class UsbFailure : public UsbBus, public ::testing::WithParamInterface<Failure> {};

TEST_P(UsbFailure, IsToldOnceInItsPlaceAndTheStreamGoesOn) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(kInFlight));
  for (int i = 0; i < 10; ++i) {
    device.send(kIn, bytes_of(8, i));
    if (GetParam().error == 0) {
      device.send(kIn, bytes_of(600));  // more than fits: babble
    } else {
      device.fail_transfer(kIn, GetParam().error);
    }
    device.send(kIn, bytes_of(9, i));
    EXPECT_EQ(read_bytes(*transport), bytes_of(8, i));
    EXPECT_EQ(read_status(*transport), GetParam().status);
    EXPECT_EQ(read_bytes(*transport), bytes_of(9, i));
  }
}

TEST_P(UsbFailure, ForEverCostsNoMoreThanOneTransferForEachRead) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  for (int i = 0; i < 200; ++i) {
    if (GetParam().error == 0) {
      device.send(kIn, bytes_of(600));
    } else {
      device.fail_transfer(kIn, GetParam().error);
    }
  }
  const std::uint64_t before = device.submits();
  EXPECT_EQ(read_status(*transport), GetParam().status);
  EXPECT_LE(device.submits() - before, 1 + kInFlight);
  constexpr int kReads = 100;
  for (int i = 1; i < kReads; ++i) EXPECT_EQ(read_status(*transport), GetParam().status);
  EXPECT_LE(device.submits() - before, kReads + kInFlight);
}

INSTANTIATE_TEST_SUITE_P(All,
                         UsbFailure,
                         ::testing::Values(Failure{"Stall", EPIPE, IoStatus::kStall},
                                           Failure{"Babble", 0, IoStatus::kOverflow},
                                           Failure{"ProtocolError", EPROTO, IoStatus::kIo},
                                           Failure{"BadChecksum", EILSEQ, IoStatus::kIo},
                                           Failure{"NoAnswer", ETIME, IoStatus::kIo}),
                         [](const auto& param_info) { return param_info.param.name; });

TEST_F(UsbBus, AStallIsClearedOnEveryEndpointAndReadingGoesOn) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  device.fail_transfer(kIn, EPIPE);
  EXPECT_EQ(read_status(*transport), IoStatus::kStall);
  EXPECT_EQ(transport->clear_stall(), IoStatus::kOk);
  EXPECT_EQ(device.cleared_halts(), 2U);  // IN and OUT
  EXPECT_EQ(device.in_flight(), 0U);      // all were taken back for it
  device.send(kIn, bytes_of(48));
  EXPECT_EQ(read_bytes(*transport), bytes_of(48));
}

TEST_F(UsbBus, SubmitsThatFailForWantOfMemoryAreTriedAgainOnceARead) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  constexpr int kRefused = 40;
  device.refuse_submits(kRefused, ENOMEM);
  ASSERT_EQ(transport->clear_stall(), IoStatus::kOk);  // takes all transfers back
  const std::uint64_t before = device.submits();
  int failures = 0;
  while (read_status(*transport, milliseconds(20)) == IoStatus::kIo) ++failures;
  EXPECT_EQ(failures, kRefused / static_cast<int>(kInFlight));
  EXPECT_EQ(device.submits() - before, kRefused + kInFlight);
  device.send(kIn, bytes_of(48));
  EXPECT_EQ(read_bytes(*transport), bytes_of(48));
}

TEST_F(UsbBus, NoMemoryAtOpeningIsAnErrorAndNotALeak) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  device.refuse_submits(2, ENOMEM);
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kIo);
  EXPECT_TRUE(device.wait_until_closed());
  EXPECT_EQ(device.in_flight(), 0U);
  EXPECT_TRUE(usb.open());
}

TEST_F(UsbBus, NobodyReadingBlocksTheDeviceRatherThanFillingMemory) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  constexpr int kSent = 300;
  for (int i = 0; i < kSent; ++i) device.send(kIn, bytes_of(2, i));
  // Writing handles what comes in meanwhile.
  for (int i = 0; i < kSent; ++i)
    ASSERT_EQ(transport->write(bytes_of(1), in(seconds(2))), IoStatus::kOk);
  EXPECT_LE(device.submits(), 64U + 2 * kInFlight + kSent);
  for (int i = 0; i < kSent; ++i) ASSERT_EQ(read_bytes(*transport), bytes_of(2, i)) << i;
}

TEST_F(UsbBus, UnplugInReadIsToldAtOnce) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  std::atomic<Time::rep> unplugged{0};
  std::thread puller([&] {
    std::this_thread::sleep_for(milliseconds(50));
    unplugged = clock_.now().time_since_epoch().count();
    device.unplug();
  });
  EXPECT_EQ(read_status(*transport, seconds(5)), IoStatus::kGone);
  const Time told = clock_.now();
  puller.join();
  EXPECT_LE(told - Time{Duration{unplugged}}, milliseconds(100));
  EXPECT_EQ(read_status(*transport), IoStatus::kGone);  // final
  EXPECT_EQ(transport->write(bytes_of(1), in(seconds(1))), IoStatus::kGone);
  EXPECT_EQ(transport->clear_stall(), IoStatus::kGone);
}

TEST_F(UsbBus, UnplugInWriteIsToldAtOnce) {
  mock::UsbDevice device(
      description(), [](std::uint8_t, const mock::Bytes&) { return mock::UsbDevice::kNeverDone; });
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  std::thread puller([&] {
    std::this_thread::sleep_for(milliseconds(50));
    device.unplug();
  });
  const Time begin = clock_.now();
  EXPECT_EQ(transport->write(bytes_of(1), in(seconds(5))), IoStatus::kGone);
  EXPECT_LE(clock_.now() - begin, milliseconds(500));
  puller.join();
}

TEST_F(UsbBus, UnplugWithReadsInFlightFreesThemAndTheDescriptorInTime) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(kInFlight));
  device.unplug();
  const Time begin = clock_.now();
  transport.reset();
  EXPECT_LE(clock_.now() - begin, milliseconds(200));
  EXPECT_TRUE(device.wait_until_closed());
}

TEST_F(UsbBus, ClosingWithReadsInFlightTakesThemBack) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(kInFlight));
  transport.reset();
  EXPECT_TRUE(device.wait_until_closed());
  EXPECT_EQ(device.in_flight(), 0U);
  EXPECT_EQ(device.discards(), kInFlight) << "rather than have the kernel clean up";
  EXPECT_TRUE(open(usb)) << "and it can be opened again";
}

TEST_F(UsbBus, WhatCameBeforeTheUnplugIsReadBeforeItIsTold) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(kInFlight));
  for (int i = 0; i < 3; ++i) device.send(kIn, bytes_of(48, i));
  device.unplug();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(read_bytes(*transport), bytes_of(48, i));
  EXPECT_EQ(read_status(*transport), IoStatus::kGone);
}

TEST_F(UsbBus, TwoUnplugsWithin100MsLeakNothingAndEndInAnOpenDevice) {
  mock::UsbDevice device(description());
  auto usb = port();
  device.plug();
  open(usb).reset();  // what libraries keep for good is there now
  ASSERT_TRUE(device.wait_until_closed());
  const std::size_t descriptors = count_descriptors();
  const std::size_t threads = count_threads();
  for (int round = 0; round < 20; ++round) {
    auto first = open(usb);
    ASSERT_TRUE(first);
    device.unplug();
    device.plug();
    auto second = open(usb);  // while the first is still open
    ASSERT_TRUE(second);
    device.unplug();
    EXPECT_EQ(read_status(*first), IoStatus::kGone);
    EXPECT_EQ(read_status(*second), IoStatus::kGone);
    first.reset();
    second.reset();
    device.plug();
    const auto third = open(usb);
    ASSERT_TRUE(third);
    device.send(kIn, bytes_of(48));
    EXPECT_EQ(read_bytes(*third), bytes_of(48));
  }
  ASSERT_TRUE(device.wait_until_closed());
  EXPECT_EQ(count_descriptors(), descriptors);
  EXPECT_EQ(count_threads(), threads);
}

TEST_F(UsbBus, OpeningStartsNoThread) {
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  const std::size_t threads = count_threads();
  const auto transport = open(usb);
  EXPECT_EQ(count_threads(), threads);
}

}  // namespace
}  // namespace veneer::tracking
