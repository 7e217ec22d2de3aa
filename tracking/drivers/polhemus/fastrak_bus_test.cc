// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string_view>
#include <thread>

#include "tracking/drivers/polhemus/fastrak_protocol.h"
#include "tracking/testing/drivers_on_the_bus.h"
#include "tracking/testing/mock_usb.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

/// Sends records of station 2 on its interrupt endpoint when it was told to.
class FastrakOnTheBus : public DriversOnTheBus {
 protected:
  static constexpr std::uint8_t kOut = 0x02;
  static constexpr std::uint8_t kAnswers = 0x82;
  static constexpr std::uint8_t kRecords = 0x84;
  static mock::UsbDescription description(std::uint16_t product) {
    return {0x0f44, product, "FASTRAK", "", "1-1", {{kOut}, {kAnswers}, {kRecords, true}}};
  }

  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(open("driver = \"polhemus\"\nmodel = \"fastrak\""));
  }
  void TearDown() override {
    ended_ = true;
    thread_.join();
    tracker_.reset();
  }
  int on_write(const mock::Bytes& bytes) {
    if (bytes[0] == std::byte{'C'}) streams_ = true;
    if (bytes[0] == std::byte{'c'}) streams_ = false;
    return 0;
  }
  void plug() {
    streams_ = false;
    usb_.plug();
  }

  std::atomic<bool> streams_{false};
  std::atomic<bool> ended_{false};
  mock::UsbDevice usb_{description(0x0002),
                       [this](std::uint8_t, const mock::Bytes& bytes) { return on_write(bytes); }};
  std::thread thread_{[this] {
    FastrakRecord record;
    record.station = 2;
    record.position_cm.z() = 150;
    const auto bytes = encode(record);
    const auto half = bytes.begin() + 13;
    while (!ended_) {
      std::this_thread::sleep_for(milliseconds(8));
      if (!streams_) continue;
      usb_.send(kRecords, {bytes.begin(), half});
      usb_.send(kRecords, {half, bytes.end()});
    }
  }};
};

TEST_F(FastrakOnTheBus, TracksFromItsInterruptEndpointAndAgainAfterAReplug) {
  plug();
  ASSERT_TRUE(tracks());
  EXPECT_EQ(newest_.body, 2);
  EXPECT_NEAR(newest_.world_from_body.translation.z(), 1.5, 1e-6);
  EXPECT_LE(newest_.time, clock_.now());
  EXPECT_TRUE(run_until_state(TrackerState::kTracking));
  streams_ = false;
  usb_.unplug();
  EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
  plug();
  EXPECT_TRUE(tracks());
  EXPECT_EQ(status().counters.skipped_bytes, 0U);
}

TEST_F(FastrakOnTheBus, AnAsciiAnswerOnTheOtherEndpointIsToldAgain) {
  plug();
  ASSERT_TRUE(tracks());
  const TrackerCounters before = status().counters;
  streams_ = false;
  for (const char c : std::string_view("01   1.25  -7.50  3.12  90.0   0.0  12.5\r\n"))
    usb_.send(kAnswers, {static_cast<std::byte>(c)});
  ASSERT_TRUE(tracks());
  EXPECT_EQ(status().counters.opened, before.opened);
  EXPECT_GE(status().counters.restarts, before.restarts + 1);
}

TEST_F(FastrakOnTheBus, WithoutFirmwareItSaysSo) {
  mock::UsbDevice bare(description(0x0001));
  bare.plug();
  EXPECT_TRUE(run_until_state(TrackerState::kFailed));
  EXPECT_THAT(status().detail, HasSubstr("needs firmware"));
}

}  // namespace
}  // namespace veneer::tracking
