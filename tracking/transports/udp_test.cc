// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/udp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <ctime>
#include <thread>

#include "tracking/testing/loopback.h"

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;

Time now() { return SteadyClock{}.now(); }

class UdpTest : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = UdpPort("127.0.0.1", port_, clock_).open();
    ASSERT_TRUE(opened) << opened.error().what;
    transport_ = *std::move(opened);
  }
  Received read(Duration patience = 5s) { return transport_->read(buffer_, now() + patience); }
  [[nodiscard]] std::string text(const Received& received) const {
    return {reinterpret_cast<const char*>(buffer_.data()), received.bytes};
  }
  void send(std::string_view text) const {
    ASSERT_TRUE(loopback::send_datagram(port_, loopback::bytes_of(text)));
  }

  /// The kernel begins to stamp some time after it was asked to, and until then says when a
  /// datagram was read.
  void wait_for_kernel_stamps() {
    const Time start = now();
    while (now() - start < 5s) {
      send("x");
      std::this_thread::sleep_for(10ms);
      const Time before = now();
      if (read().arrival < before - 5ms) return;
    }
    FAIL() << "there are no stamps";
  }

  SteadyClock clock_;
  int port_ = loopback::free_port(SOCK_DGRAM);
  std::unique_ptr<Transport> transport_;
  std::array<std::byte, Transport::kLargestMessage> buffer_{};
};

TEST_F(UdpTest, WhatHasQueuedComesOutWholeInOrderAndWithTheTimeOfItsArrival) {
  wait_for_kernel_stamps();
  std::vector<Time> sent;
  for (int i = 0; i < 20; ++i) {
    sent.push_back(now());
    send(std::string(static_cast<std::size_t>(i) + 1, static_cast<char>('a' + i)));
    std::this_thread::sleep_for(1ms);
  }
  std::this_thread::sleep_for(20ms);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const Received received = read(0s);  // it is there: no patience is needed
    ASSERT_EQ(received.status, IoStatus::kOk) << i;
    EXPECT_EQ(text(received), std::string(i + 1, static_cast<char>('a' + i)));
    EXPECT_GE(received.arrival, sent[i] - 1ms);
    // The kernel's stamp, not the moment of reading; the last of them was read 20 ms later.
    if (i + 1 < sent.size()) {
      EXPECT_LE(received.arrival, sent[i + 1] + 1ms);
    }
  }
  EXPECT_EQ(read(0s).status, IoStatus::kTimeout);
}

TEST_F(UdpTest, WaitsForTheDeadlineWithoutSpinning) {
  const std::clock_t cpu = std::clock();
  const Time start = now();
  EXPECT_EQ(read(60ms).status, IoStatus::kTimeout);
  EXPECT_GE(now() - start, 60ms);
  EXPECT_LT(static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC, 0.03);
}

TEST_F(UdpTest, ADatagramInTheMiddleOfTheWaitEndsIt) {
  std::jthread sender([this] {
    std::this_thread::sleep_for(20ms);
    send("late");
  });
  const Received received = read();
  EXPECT_EQ(text(received), "late");
  EXPECT_LE(received.arrival, now());
}

TEST_F(UdpTest, ATooLongDatagramIsAnOverflowAndTheNextIsWhole) {
  send(std::string(buffer_.size() + 1, 'x'));
  send("next");
  const Received overflow = read();
  EXPECT_EQ(overflow.status, IoStatus::kOverflow);
  EXPECT_EQ(overflow.bytes, 0U);
  EXPECT_EQ(text(read()), "next");
}

TEST_F(UdpTest, AnEmptyDatagramIsOne) {
  send("");
  send("next");
  const Received empty = read();
  EXPECT_EQ(empty.status, IoStatus::kOk);
  EXPECT_EQ(empty.bytes, 0U);
  EXPECT_EQ(text(read()), "next");
}

TEST_F(UdpTest, APortThatIsTakenIsNamedWithAWayToFindTheOther) {
  const auto second = UdpPort("127.0.0.1", port_, clock_).open();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kUnavailable);
  EXPECT_THAT(second.error().what, testing::HasSubstr(fmt::format("ss -ulpn sport = :{}", port_)));
  transport_.reset();  // closes
  EXPECT_TRUE(UdpPort("127.0.0.1", port_, clock_).open());
}

TEST_F(UdpTest, AnAddressThatIsNoneOfOursIsNotFound) {
  // TEST-NET-1 of RFC 5737: nobody's.
  EXPECT_EQ(UdpPort("192.0.2.1", port_, clock_).open().error().code, Errc::kNotFound);
  EXPECT_EQ(UdpPort("no address", port_, clock_).open().error().code, Errc::kUnavailable);
}

TEST(UdpPort, WaitsOnItsClockAlone) {
  VirtualClock clock;
  EXPECT_FALSE(UdpPort("127.0.0.1", 1, clock).wait_for_arrival(Time{1h}));
  EXPECT_EQ(clock.now(), Time{1h});
}

}  // namespace
}  // namespace veneer::tracking
