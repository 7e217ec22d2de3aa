// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <thread>

#include "tracking/testing/usb_bus.h"

// Which device is opened, why it cannot be, and how its arrival is waited for.
namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

constexpr std::uint8_t kInterruptIn = 0x84;

TEST_F(UsbBus, AbsenceIsToldWithWhatToDo) {
  auto usb = port();
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kNotFound);
  EXPECT_THAT(transport.error().what, HasSubstr("LIBERTY 0f44:ff20"));
  EXPECT_THAT(transport.error().what, HasSubstr("plugged in"));
}

TEST_F(UsbBus, ADeviceWithoutFirmwareNeedsFirmwareAndIsNotAbsent) {
  auto boot = description();
  boot.product = 0xff21;
  mock::UsbDevice device(boot);
  auto usb = port();
  device.plug();
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kUnavailable);
  EXPECT_THAT(transport.error().what, HasSubstr("needs firmware"));
  EXPECT_THAT(transport.error().what, HasSubstr("fxload"));
  // And when it has got it, it comes back under its other number.
  device.unplug();
  mock::UsbDevice loaded(description());
  loaded.plug();
  EXPECT_TRUE(usb.wait_for_arrival(in(seconds(2))));
  EXPECT_TRUE(usb.open());
}

TEST_F(UsbBus, ADeviceThatAnotherProgramHoldsSaysSo) {
  mock::UsbDevice device(description());
  device.plug();
  device.refuse_claims(EBUSY);
  auto usb = port();
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kUnavailable);
  EXPECT_THAT(transport.error().what, HasSubstr("another program holds it"));
  EXPECT_TRUE(device.wait_until_closed());
}

TEST_F(UsbBus, AKernelDriverIsDetached) {
  mock::UsbDevice device(description());
  device.plug();
  device.bind_kernel_driver(true);
  auto usb = port();
  EXPECT_TRUE(open(usb));
  EXPECT_FALSE(device.has_kernel_driver());
}

TEST_F(UsbBus, PermissionDeniedNamesTheRuleAndTheGroup) {
  mock::UsbDevice device(description());
  device.plug();
  device.forbid_opening();
  auto usb = port();
  constexpr uid_t kNobody = 65534;
  const uid_t self = ::geteuid();
  ASSERT_EQ(::seteuid(self == 0 ? kNobody : self), 0);
  const auto transport = usb.open();
  ASSERT_EQ(::seteuid(self), 0);
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kUnavailable);
  EXPECT_THAT(transport.error().what, HasSubstr("60-veneer-trackers.rules"));
  EXPECT_THAT(transport.error().what, HasSubstr("plugdev"));
}

TEST_F(UsbBus, EndpointsAreFoundInTheDescriptorsWhereTheTableHasNone) {
  auto fastrak = description();
  fastrak.endpoints = {{0x02}, {0x82}, {kInterruptIn, true}};
  mock::UsbDevice device(fastrak);
  device.plug();
  UsbModel model = kModel;
  model.out = 0;
  model.in = {};
  UsbBulkPort usb("FASTRAK", {model}, {}, clock_);
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(device.wait_for_reads_in_flight(2 * kInFlight));
  device.send(0x82, bytes_of(3));
  EXPECT_EQ(read_bytes(*transport), bytes_of(3));
  device.send(kInterruptIn, bytes_of(5));
  EXPECT_EQ(read_bytes(*transport), bytes_of(5));
  EXPECT_EQ(transport->write(bytes_of(3), in(seconds(2))), IoStatus::kOk);
}

TEST_F(UsbBus, ADeviceWithoutTheEndpointsIsRefused) {
  auto mute = description();
  mute.endpoints = {{kOut}};
  mock::UsbDevice device(mute);
  device.plug();
  UsbModel model = kModel;
  model.out = 0;
  UsbBulkPort usb("LIBERTY", {model}, {}, clock_);
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kIo);
  EXPECT_TRUE(device.wait_until_closed());
}

// Identity.

TEST_F(UsbBus, AReplugWithAnotherSerialNumberIsNotAdopted) {
  mock::UsbDevice device(description("A1"));
  device.plug();
  auto usb = port();
  open(usb).reset();
  device.unplug();
  mock::UsbDevice other(description("B2"));
  other.plug();
  const auto transport = usb.open();
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, Errc::kNotFound);
  EXPECT_THAT(transport.error().what, HasSubstr("A1"));
  EXPECT_THAT(transport.error().what, HasSubstr("B2"));
}

TEST_F(UsbBus, AReplugIntoAnotherPortIsAdoptedByItsSerialNumber) {
  mock::UsbDevice device(description("A1", "1-1"));
  device.plug();
  auto usb = port();
  open(usb).reset();
  device.unplug();
  mock::UsbDevice other(description("B2", "1-1"));
  other.plug();
  device.move_to("1-2.3");
  device.plug();
  const auto transport = open(usb);
  ASSERT_TRUE(transport);
  EXPECT_EQ(device.openers(), 1);
  EXPECT_EQ(other.openers(), 0);
}

TEST_F(UsbBus, WithoutSerialNumbersThePortTells) {
  mock::UsbDevice left(description("", "1-1"));
  mock::UsbDevice right(description("", "1-2"));
  left.plug();
  auto usb = port();
  open(usb).reset();
  right.plug();
  auto transport = open(usb);
  EXPECT_EQ(left.openers(), 1);
  transport.reset();
  left.unplug();
  transport = open(usb);  // the only one there is: somebody has moved it
  EXPECT_EQ(right.openers(), 1);
}

TEST_F(UsbBus, OfSeveralTheKeysSayWhich) {
  mock::UsbDevice one(description("A1", "1-1"));
  mock::UsbDevice two(description("B2", "1-2"));
  one.plug();
  two.plug();
  auto any = port();
  const auto unclear = any.open();
  ASSERT_FALSE(unclear);
  EXPECT_EQ(unclear.error().code, Errc::kInvalidOption);
  EXPECT_THAT(unclear.error().what, HasSubstr("A1"));
  EXPECT_THAT(unclear.error().what, HasSubstr("B2"));
  auto by_serial = port(UsbIdentity("B2", ""));
  auto by_port = port(UsbIdentity("", "1-1"));
  const auto second = open(by_serial);
  EXPECT_EQ(two.openers(), 1);
  const auto first = open(by_port);
  EXPECT_EQ(one.openers(), 1);
}

// Hot-plug.

TEST_F(UsbBus, AnArrivalEndsTheWait) {
  mock::UsbDevice device(description());
  auto usb = port();
  std::thread plugger([&] {
    std::this_thread::sleep_for(milliseconds(50));
    device.plug();
  });
  const Time begin = clock_.now();
  EXPECT_TRUE(usb.wait_for_arrival(in(seconds(5))));
  EXPECT_LE(clock_.now() - begin, seconds(1));
  plugger.join();
  EXPECT_TRUE(open(usb));
}

TEST_F(UsbBus, AnotherDevicesArrivalOrADepartureDoesNot) {
  auto mouse_description = description("", "1-4");
  mouse_description.vendor = 0x046d;
  mock::UsbDevice mouse(mouse_description);
  mock::UsbDevice device(description());
  device.plug();
  auto usb = port();
  open(usb).reset();
  device.unplug();
  mouse.plug();
  const Time begin = clock_.now();
  EXPECT_FALSE(usb.wait_for_arrival(in(milliseconds(200))));
  EXPECT_GE(clock_.now() - begin, milliseconds(199));
}

TEST_F(UsbBus, WhatArrivedBeforeTheLastOpeningDoesNotEndTheWait) {
  mock::UsbDevice device(description());
  auto usb = port();
  device.plug();
  open(usb).reset();
  device.unplug();
  EXPECT_FALSE(usb.wait_for_arrival(in(milliseconds(50))));
}

}  // namespace
}  // namespace veneer::tracking
