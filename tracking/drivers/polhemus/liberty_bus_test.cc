// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <thread>
#include <vector>

#include "base/random.h"
#include "tracking/testing/drivers_on_the_bus.h"
#include "tracking/testing/holdings.h"
#include "tracking/testing/mock_liberty.h"
#include "tracking/usb_access.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

/// What 1.5 s of a broken device may cost: openings that back off from 0.1 s, each with a few tens
/// of calls, and the mock's 500 calls a second while it is open.
constexpr std::uint64_t kMostOpenings = 8;
constexpr std::uint64_t kMostIoctls = 750 + 100 * kMostOpenings;

class LibertyOnTheBus : public DriversOnTheBus {
 protected:
  void SetUp() override { ASSERT_NO_FATAL_FAILURE(open("driver = \"polhemus\"")); }
  // Ours before the bus's: the tracker has the device open.
  void TearDown() override { tracker_.reset(); }
  mock::Liberty liberty_;
};

TEST_F(LibertyOnTheBus, IsStartedAndTracks) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  EXPECT_EQ(newest_.body, 1);
  EXPECT_NEAR(newest_.world_from_body.translation.z(), 1.5, 1e-6);
  EXPECT_TRUE(run_until_state(TrackerState::kTracking));
  EXPECT_LE(newest_.time, clock_.now());
  EXPECT_GE(newest_.time, clock_.now() - seconds(1));
  EXPECT_EQ(status().counters.opened, 1U);
}

TEST_F(LibertyOnTheBus, IsWaitedForWhileAbsent) {
  run_for(milliseconds(100));
  EXPECT_EQ(status().state, TrackerState::kAbsent);
  EXPECT_THAT(status().detail, HasSubstr("LIBERTY"));
  liberty_.plug();
  const Time plugged = clock_.now();
  ASSERT_TRUE(tracks());
  EXPECT_LE(clock_.now() - plugged, seconds(2)) << "the arrival ends the wait";
}

TEST_F(LibertyOnTheBus, IsFoundByWhoLooksForTrackersWithoutOpeningIt) {
  EXPECT_TRUE(usb_devices().empty());
  liberty_.plug();
  const std::vector<UsbDevice> devices = usb_devices();
  ASSERT_EQ(devices.size(), 1U);
  EXPECT_EQ(devices[0].driver, "polhemus");
  EXPECT_EQ(devices[0].serial, "L1");
  EXPECT_EQ(devices[0].port, "1-1");
  const Status access = check_access(devices[0]);
  EXPECT_TRUE(access) << access.error().what;
  EXPECT_EQ(liberty_.usb().openers(), 0);
  liberty_.unplug();
  ASSERT_FALSE(check_access(devices[0])) << "it went away meanwhile";
}

TEST_F(LibertyOnTheBus, UnplugIsToldAndReplugTakesItUpAgain) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  for (std::uint64_t i = 2; i < 5; ++i) {
    liberty_.unplug();
    EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
    liberty_.plug();
    ASSERT_TRUE(tracks());
    EXPECT_EQ(status().counters.opened, i);
    EXPECT_EQ(liberty_.starts(), i) << "told again what to send, once";
  }
}

TEST_F(LibertyOnTheBus, UnplugAtAnyMomentOfTheStartIsSurvived) {
  for (int step = 0; step < 6; ++step) {
    liberty_.plug();
    std::thread puller([&] {
      std::this_thread::sleep_for(milliseconds(25 * step));
      liberty_.unplug();
    });
    EXPECT_TRUE(run_until([&] { return !liberty_.usb().is_plugged(); }));
    puller.join();
    EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
  }
  liberty_.plug();
  EXPECT_TRUE(tracks());
}

TEST_F(LibertyOnTheBus, TwoUnplugsWithin100MsLeakNothing) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  const std::size_t descriptors = count_descriptors();
  for (int i = 0; i < 10; ++i) {
    liberty_.unplug();
    run_for(milliseconds(20));
    liberty_.plug();
    run_for(milliseconds(30));
    liberty_.unplug();
    run_for(milliseconds(20));
    liberty_.plug();
    ASSERT_TRUE(tracks());
  }
  EXPECT_LE(count_descriptors(), descriptors + 3);  // the mock closes a moment later
  EXPECT_EQ(liberty_.usb().openers(), 1);
}

TEST_F(LibertyOnTheBus, AnotherSerialNumberIsNotAdoptedAndAnotherPortIs) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  liberty_.unplug();
  mock::Liberty other("L2", "1-1");
  other.plug();
  EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
  run_for(milliseconds(500));
  EXPECT_EQ(other.starts(), 0U);
  EXPECT_THAT(status().detail, HasSubstr("L2"));
  liberty_.usb().move_to("1-3");
  liberty_.plug();
  EXPECT_TRUE(tracks());
  EXPECT_EQ(other.starts(), 0U);
}

TEST_F(LibertyOnTheBus, AnotherDevicesArrivalDisturbsNothing) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  mock::UsbDevice mouse({0x046d, 0xc077, "Mouse", "", "1-4", {{0x81, true}}});
  const TrackerCounters before = status().counters;
  for (int i = 0; i < 2; ++i) {
    mouse.plug();
    ASSERT_TRUE(tracks());
    mouse.unplug();
    ASSERT_TRUE(tracks());
  }
  EXPECT_EQ(status().counters.opened, before.opened);
  EXPECT_EQ(status().counters.io_errors, before.io_errors);
}

TEST_F(LibertyOnTheBus, WithoutFirmwareItSaysSo) {
  mock::UsbDevice bare({mock::Liberty::kVendor,
                        mock::Liberty::kBootProduct,
                        "LIBERTY",
                        "",
                        "1-1",
                        {{mock::Liberty::kOut}, {mock::Liberty::kIn}}});
  bare.plug();
  EXPECT_TRUE(run_until_state(TrackerState::kFailed));
  EXPECT_THAT(status().detail, HasSubstr("needs firmware"));
  bare.unplug();
  liberty_.plug();  // renumbered, as after loading
  EXPECT_TRUE(tracks());
}

TEST_F(LibertyOnTheBus, FramesSplitAnywhereAndShortReadsLoseNothing) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  ASSERT_TRUE(run_until_state(TrackerState::kTracking));
  liberty_.forget();  // the stream is ours from here on
  run_for(milliseconds(10));
  const TrackerCounters before = status().counters;
  PolhemusFrame frame;
  frame.position_cm.z() = 150;
  mock::Bytes stream;
  constexpr std::uint32_t kFrames = 100;
  const auto encoded_newest = liberty_.newest_frame();
  frame.count = decode(encoded_newest).count;
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    ++frame.count;
    const auto bytes = encode(frame, PolhemusModel::kLiberty);
    stream.insert(stream.end(), bytes.begin(), bytes.end());
  }
  std::size_t at = 0;
  for (std::size_t i = 0; at < stream.size(); ++i) {
    constexpr std::array<std::size_t, 5> kSizes{0, 1, 7, 8, 47};
    const std::size_t size = std::min(kSizes[i % kSizes.size()], stream.size() - at);
    const auto begin = stream.begin() + static_cast<std::ptrdiff_t>(at);
    liberty_.usb().send(mock::Liberty::kIn, {begin, begin + static_cast<std::ptrdiff_t>(size)});
    at += size;
  }
  EXPECT_TRUE(run_until([&] {
    const TrackerCounters& now = status().counters;
    return now.samples + now.clock_outliers >= before.samples + before.clock_outliers + kFrames;
  }));
  EXPECT_EQ(status().counters.skipped_bytes, before.skipped_bytes);
}

struct BusFault {
  const char* name;
  int error;  ///< 0: babble
};

class LibertyWithFaults : public LibertyOnTheBus, public ::testing::WithParamInterface<BusFault> {
 protected:
  void inject() {
    if (GetParam().error == 0) {
      liberty_.usb().send(mock::Liberty::kIn, mock::Bytes(600, std::byte{0xAA}));
    } else {
      liberty_.usb().fail_transfer(mock::Liberty::kIn, GetParam().error);
    }
  }
};

TEST_P(LibertyWithFaults, OneNowAndThenIsCountedAndTrackingGoesOn) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  const TrackerCounters before = status().counters;
  for (int i = 0; i < 3; ++i) {
    inject();
    ASSERT_TRUE(tracks());  // samples in between tell a fault from a broken device
  }
  EXPECT_GE(status().counters.io_errors, before.io_errors + 3);
  // A busy machine may not get its transfers back in time to clear a halt, and open it again.
  EXPECT_LE(status().counters.opened, before.opened + 1) << "no reason to open it each time";
}

TEST_P(LibertyWithFaults, ForEverIsBoundedInWorkAndEndsWhenTheFaultsDo) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  liberty_.forget();
  std::atomic<bool> broken{true};
  std::thread faults([&] {
    while (broken) {
      inject();
      std::this_thread::sleep_for(milliseconds(1));
    }
  });
  const std::uint64_t ioctls = liberty_.usb().ioctls();
  const std::uint64_t openings = status().counters.opened;
  run_for(milliseconds(1500));
  const std::uint64_t ioctls_used = liberty_.usb().ioctls() - ioctls;
  const std::uint64_t openings_used = status().counters.opened - openings;
  broken = false;
  faults.join();
  liberty_.usb().flush();
  EXPECT_LE(openings_used, kMostOpenings);
  EXPECT_LE(ioctls_used, kMostIoctls);
  EXPECT_TRUE(tracks());
}

INSTANTIATE_TEST_SUITE_P(All,
                         LibertyWithFaults,
                         ::testing::Values(BusFault{"Stall", EPIPE},
                                           BusFault{"Babble", 0},
                                           BusFault{"ProtocolError", EPROTO}),
                         [](const auto& param_info) { return param_info.param.name; });

TEST_F(LibertyOnTheBus, SilenceForEverIsToldAndBoundedInWork) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  liberty_.ignore_writes(true);
  liberty_.forget();
  EXPECT_TRUE(run_until([&] { return status().state != TrackerState::kTracking; }));
  const std::uint64_t ioctls = liberty_.usb().ioctls();
  run_for(milliseconds(1500));
  EXPECT_LE(liberty_.usb().ioctls() - ioctls, kMostIoctls);
  liberty_.ignore_writes(false);
  EXPECT_TRUE(tracks());
}

TEST_F(LibertyOnTheBus, ADeviceThatHasForgottenIsToldAgainWithoutOpeningItAgain) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  const TrackerCounters before = status().counters;
  liberty_.forget();
  ASSERT_TRUE(tracks());
  EXPECT_EQ(status().counters.opened, before.opened);
  EXPECT_EQ(status().counters.restarts, before.restarts + 1);
}

TEST_F(LibertyOnTheBus, NoMemoryToSubmitIsSurvived) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  constexpr int kRefused = 12;  // for three errors, and an opening or two
  const std::uint64_t submits = liberty_.usb().submits();
  liberty_.usb().refuse_submits(kRefused, ENOMEM);
  ASSERT_TRUE(run_until([&] { return liberty_.usb().submits() > submits + kRefused; }));
  EXPECT_TRUE(tracks());
}

TEST_F(LibertyOnTheBus, AfterManyRandomFaultsItTracksAsBefore) {
  liberty_.plug();
  ASSERT_TRUE(tracks());
  std::atomic<bool> ended{false};
  std::thread faults([&] {
    Pcg32 random(5);
    for (int i = 0; i < 1000; ++i) {
      mock::inject_random_fault(random, liberty_);
      std::this_thread::sleep_for(milliseconds(4));
    }
    ended = true;
  });
  EXPECT_TRUE(run_until([&] { return ended.load(); }, seconds(60)));
  faults.join();
  EXPECT_TRUE(tracks());
  EXPECT_TRUE(run_until_state(TrackerState::kTracking));
  // And at once: nothing that was said falsely lasts.
  const std::uint64_t before = samples_;
  run_for(seconds(1));
  EXPECT_GE(samples_, before + 200) << status().detail;
}

}  // namespace
}  // namespace veneer::tracking
