// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <mutex>
#include <thread>

#include "tracking/testing/holdings.h"
#include "tracking/testing/mock_hidraw.h"
#include "tracking/transports/hid.h"

// The real hidapi on a mocked bus. Times here are real, so that limits on them are loose.
namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

const HidModel kModel{{{0x1532, 0x0300}, {0x1532, 0x0301}}, 0, std::nullopt};

mock::HidDescription description(std::string serial = "A1",
                                 std::string usb_port = "2-1",
                                 int interface = 0) {
  return {0x1532, 0x0300, "Razer Hydra", std::move(serial), std::move(usb_port), interface};
}

mock::Bytes report_of(std::size_t size, int first) {
  mock::Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i)
    bytes[i] = static_cast<std::byte>(first + static_cast<int>(i));
  return bytes;
}

class HidBus : public ::testing::Test {
 protected:
  HidPort port(UsbIdentity identity = {}, HidModel model = kModel) {
    return HidPort("Razer Hydra", std::move(model), std::move(identity), clock_);
  }
  std::unique_ptr<Transport> open(Port& port) {
    auto transport = port.open();
    EXPECT_TRUE(transport) << transport.error().what;
    return transport ? *std::move(transport) : nullptr;
  }
  Time in(Duration duration) { return clock_.now() + duration; }
  IoStatus read_status(Transport& transport, Duration patience = seconds(2)) {
    return transport.read(buffer_, in(patience)).status;
  }
  mock::Bytes read_bytes(Transport& transport, Duration patience = seconds(2)) {
    const Received received = transport.read(buffer_, in(patience));
    return {buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(received.bytes)};
  }

  SteadyClock clock_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(Transport::kLargestMessage);
};

TEST_F(HidBus, ReportsKeepTheirBoundsAndOrder) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  for (int round = 0; round < 10; ++round) {
    const std::vector sizes{52U, 1U, 51U, 53U, 16U, 52U, 64U};
    for (const std::size_t size : sizes) device.send(report_of(size, round));
    for (const std::size_t size : sizes) EXPECT_EQ(read_bytes(*transport), report_of(size, round));
  }
  EXPECT_EQ(read_status(*transport, Duration{}), IoStatus::kTimeout);
}

TEST_F(HidBus, AReportThatArrivesEndsTheWait) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  std::thread sender([&] {
    std::this_thread::sleep_for(milliseconds(50));
    device.send(report_of(52, 1));
  });
  const Time begin = clock_.now();
  const Received received = transport->read(buffer_, in(seconds(5)));
  sender.join();
  EXPECT_EQ(received.status, IoStatus::kOk);
  EXPECT_GE(received.arrival, begin);
  EXPECT_LE(received.arrival, begin + seconds(1));
}

TEST_F(HidBus, SilenceIsATimeoutWithoutASingleRead) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  const Time begin = clock_.now();
  EXPECT_EQ(read_status(*transport, milliseconds(100)), IoStatus::kTimeout);
  EXPECT_GE(clock_.now() - begin, milliseconds(100));
  EXPECT_LE(clock_.now() - begin, milliseconds(400));
  EXPECT_EQ(device.reads(), 0U);
}

TEST_F(HidBus, FeatureReportsArriveWhole) {
  std::mutex mutex;
  mock::Bytes last;
  mock::HidrawDevice device(description(), [&](const mock::Bytes& report) {
    const std::lock_guard lock(mutex);
    last = report;
    return 0;
  });
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  EXPECT_EQ(transport->send_feature(report_of(91, 0)), IoStatus::kOk);
  const std::lock_guard lock(mutex);
  EXPECT_EQ(last, report_of(91, 0));
}

TEST_F(HidBus, FeatureReportsGoToTheControlInterfaceWhereThereIsOne) {
  HidModel model = kModel;
  model.control_interface = 1;
  mock::HidrawDevice data(description());
  mock::HidrawDevice control(description("A1", "2-1", 1));
  mock::HidrawDevice other_control(description("B2", "2-2", 1));
  other_control.plug();
  data.plug();
  auto hid = port({}, model);
  const auto too_early = hid.open();  // the interfaces of a device come one after the other
  ASSERT_FALSE(too_early);
  EXPECT_EQ(too_early.error().code, Errc::kNotFound);
  control.plug();
  EXPECT_TRUE(hid.wait_for_arrival(in(seconds(2))));
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  EXPECT_EQ(transport->send_feature(report_of(91, 0)), IoStatus::kOk);
  EXPECT_EQ(control.features(), 1U);
  EXPECT_EQ(data.features(), 0U);
  EXPECT_EQ(other_control.openings(), 0U);
  data.send(report_of(52, 3));
  EXPECT_EQ(read_bytes(*transport), report_of(52, 3));
}

TEST_F(HidBus, UnplugInReadIsToldAtOnceAndClosesTheNode) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  open(hid).reset();  // what libraries keep for good is there now
  const std::size_t descriptors = count_descriptors();
  const auto transport = open(hid);
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
  EXPECT_EQ(transport->send_feature(report_of(91, 0)), IoStatus::kGone);
  EXPECT_LE(count_descriptors(), descriptors);  // though the transport still stands
}

TEST_F(HidBus, UnplugBetweenOpeningAndTheFirstFeatureIsTold) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  device.unplug();
  EXPECT_EQ(transport->send_feature(report_of(91, 0)), IoStatus::kGone);
}

TEST_F(HidBus, AReadThatFailsIsTheEndOfIt) {
  mock::HidrawDevice device(description());
  device.plug();
  auto hid = port();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  device.send(report_of(52, 1));
  device.fail_read(EIO);
  device.send(report_of(52, 2));
  EXPECT_EQ(read_bytes(*transport), report_of(52, 1));
  EXPECT_EQ(read_status(*transport), IoStatus::kGone);
  const std::uint64_t reads = device.reads();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(read_status(*transport), IoStatus::kGone);
  EXPECT_EQ(device.reads(), reads);
}

TEST_F(HidBus, ManyReplugsUnderEverNewNumbersLeakNothing) {
  constexpr int kReplugs = 20;
  mock::HidrawDevice device(description());
  auto hid = port();
  device.plug();
  open(hid).reset();
  // umockdev keeps a descriptor for each plug, which are not ours to mind.
  const auto descriptors_kept = [&](bool use) {
    const std::size_t before = count_descriptors();
    for (int i = 0; i < kReplugs; ++i) {
      device.unplug();
      const std::string node = device.node();
      device.plug();
      EXPECT_NE(device.node(), node);
      if (!use) {  // but hear of it: the mock does not put up with those who never listen
        while (hid.wait_for_arrival(clock_.now())) {
        }
        continue;
      }
      const auto transport = open(hid);
      EXPECT_TRUE(transport);
      if (!transport) break;
      device.send(report_of(52, i));
      EXPECT_EQ(read_bytes(*transport), report_of(52, i));
    }
    return count_descriptors() - before;
  };
  const std::size_t by_the_mock = descriptors_kept(false);
  // The mock's end of a connection goes a moment after ours.
  EXPECT_LE(descriptors_kept(true), by_the_mock + 3);
}

TEST_F(HidBus, AReplugWithAnotherSerialNumberIsNotAdopted) {
  mock::HidrawDevice device(description("A1"));
  device.plug();
  auto hid = port();
  open(hid).reset();
  device.unplug();
  mock::HidrawDevice other(description("B2"));
  other.plug();
  const auto transport = hid.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kNotFound);
  EXPECT_THAT(transport.error().what, HasSubstr("A1"));
}

TEST_F(HidBus, AReplugIntoAnotherPortIsAdoptedByItsSerialNumber) {
  mock::HidrawDevice device(description("A1", "2-1"));
  device.plug();
  auto hid = port();
  open(hid).reset();
  device.unplug();
  mock::HidrawDevice other(description("B2", "2-1"));
  other.plug();
  device.move_to("2-3");
  device.plug();
  const std::uint64_t openings = device.openings();
  const auto transport = open(hid);
  ASSERT_TRUE(transport);
  device.send(report_of(52, 0));
  EXPECT_EQ(read_bytes(*transport), report_of(52, 0));
  EXPECT_EQ(device.openings(), openings + 1);
  EXPECT_EQ(other.openings(), 0U);
}

TEST_F(HidBus, OtherInterfacesAreNotOpened) {
  mock::HidrawDevice keyboard(description("A1", "2-1", 2));
  keyboard.plug();
  auto hid = port();
  const auto transport = hid.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kNotFound);
}

TEST_F(HidBus, AnArrivalEndsTheWaitAndAnotherDevicesDoesNot) {
  auto mouse_description = description("", "2-4");
  mouse_description.vendor = 0x046d;
  mock::HidrawDevice mouse(mouse_description);
  mock::HidrawDevice device(description());
  auto hid = port();
  mouse.plug();
  EXPECT_FALSE(hid.wait_for_arrival(in(milliseconds(100))));
  std::thread plugger([&] {
    std::this_thread::sleep_for(milliseconds(50));
    device.plug();
  });
  EXPECT_TRUE(hid.wait_for_arrival(in(seconds(5))));
  plugger.join();
  EXPECT_TRUE(open(hid));
}

}  // namespace
}  // namespace veneer::tracking
