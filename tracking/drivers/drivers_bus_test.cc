// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <functional>
#include <mutex>
#include <set>
#include <string_view>
#include <thread>

#include "base/random.h"
#include "tracking/drivers.h"
#include "tracking/drivers/polhemus/fastrak_protocol.h"
#include "tracking/testing/mock_hidraw.h"
#include "tracking/testing/mock_liberty.h"
#include "tracking/usb_access.h"

// Drivers as the daemon opens them, the real libusb and hidapi below them, on a mocked bus. Times
// here are real, so that limits on them are loose.
namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

std::size_t count_descriptors() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    ++count;
  return count;
}

class DriversOnTheBus : public ::testing::Test {
 protected:
  void open(const std::string& config) {
    auto toml = TomlReader::parse(config, "test");
    ASSERT_TRUE(toml);
    auto tracker = open_tracker(*toml, clock_);
    ASSERT_TRUE(tracker) << tracker.error().what;
    const Status finished = toml->finish();
    ASSERT_TRUE(finished) << finished.error().what;
    tracker_ = *std::move(tracker);
  }
  /// Lets the tracker work until `done`; false if that takes too long.
  bool run_until(const std::function<bool()>& done, Duration patience = seconds(10)) {
    const Time give_up = clock_.now() + patience;
    while (!done() && clock_.now() < give_up) {
      const auto sample = tracker_->wait_pose(milliseconds(20));
      if (sample) {
        newest_ = *sample;
        ++samples_;
      } else {
        EXPECT_EQ(sample.error().code, Errc::kTimeout) << sample.error().what;
      }
    }
    return done();
  }
  void run_for(Duration duration) {
    const Time end = clock_.now() + duration;
    EXPECT_FALSE(run_until([] { return false; }, end - clock_.now()));
  }
  bool run_until_state(TrackerState state) {
    return run_until([this, state] { return tracker_->status().state == state; });
  }
  /// Whether samples come, now.
  bool tracks() {
    const std::uint64_t before = samples_;
    return run_until([&] { return samples_ >= before + 10; });
  }
  TrackerStatus status() const { return tracker_->status(); }

  SteadyClock clock_;
  std::unique_ptr<Tracker> tracker_;
  PoseSample newest_;
  std::uint64_t samples_ = 0;
};

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

// FASTRAK.

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

// Razer Hydra.

mock::Bytes motion_report() {
  mock::Bytes report(52);
  for (const std::size_t block : {std::size_t{8}, std::size_t{30}}) {
    report[block] = std::byte{100};       // x = 100 mm
    report[block + 7] = std::byte{0x7F};  // w = 0x7F00 / 32768
  }
  return report;
}

/// Two nodes of one device, which sends motion when it was told to.
class HydraOnTheBus : public DriversOnTheBus {
 protected:
  void SetUp() override { ASSERT_NO_FATAL_FAILURE(open("driver = \"razer-hydra\"")); }
  void TearDown() override {
    ended_ = true;
    thread_.join();
    tracker_.reset();
  }
  void plug() {
    motion_ = false;
    control_.plug();
    data_.plug();
  }
  void unplug() {
    data_.unplug();
    control_.unplug();
  }

  std::atomic<bool> motion_{false};
  std::atomic<std::size_t> other_size_{0};  // of the reports without motion; 0: none
  std::atomic<bool> ended_{false};
  mock::HidrawDevice control_{{0x1532, 0x0300, "Razer Hydra", "H1", "2-1", 1},
                              [this](const mock::Bytes& report) {
                                motion_ = report[9] == std::byte{3};
                                return 0;
                              }};
  mock::HidrawDevice data_{{0x1532, 0x0300, "Razer Hydra", "H1", "2-1", 0}};
  std::thread thread_{[this] {
    while (!ended_) {
      std::this_thread::sleep_for(milliseconds(4));
      if (motion_) {
        data_.send(motion_report());
      } else if (other_size_ > 0) {
        data_.send(mock::Bytes(other_size_));
      }
    }
  }};
};

TEST_F(HydraOnTheBus, IsToldToReportMotionAndTracksBothControllers) {
  plug();
  ASSERT_TRUE(tracks());
  std::set<BodyId> bodies;
  ASSERT_TRUE(run_until([&] {
    if (samples_ > 0) bodies.insert(newest_.body);
    return bodies.size() == 2;
  }));
  EXPECT_EQ(bodies, (std::set<BodyId>{1, 2}));
  EXPECT_NEAR(newest_.world_from_body.translation.x(), 0.1, 1e-9);
}

TEST_F(HydraOnTheBus, ReplugUnderAnotherNumberTracksAgain) {
  plug();
  ASSERT_TRUE(tracks());
  const std::string node = data_.node();
  unplug();
  EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
  plug();
  EXPECT_NE(data_.node(), node);
  EXPECT_TRUE(tracks());
}

TEST_F(HydraOnTheBus, AModeLostBehindOurBackIsSetAgainWithoutOpeningItAgain) {
  plug();
  ASSERT_TRUE(tracks());
  for (const std::size_t size : {std::size_t{16}, std::size_t{51}, std::size_t{53}}) {
    const TrackerCounters before = status().counters;
    const std::uint64_t features = control_.features();
    other_size_ = size;
    motion_ = false;
    ASSERT_TRUE(run_until([&] { return control_.features() > features; })) << size;
    ASSERT_TRUE(tracks()) << size;
    EXPECT_EQ(status().counters.opened, before.opened);
    // Once, as a rule; on a busy machine what was sent before may still be read after it.
    EXPECT_LE(control_.features(), features + 3);
    EXPECT_GE(status().counters.bad_frames, before.bad_frames + 1);
  }
}

TEST_F(HydraOnTheBus, StrangeReportsAmongTheOthersAreDroppedOnly) {
  plug();
  ASSERT_TRUE(tracks());
  const TrackerCounters before = status().counters;
  for (const std::size_t size :
       {std::size_t{51}, std::size_t{53}, std::size_t{16}, std::size_t{1}}) {
    data_.send(mock::Bytes(size, std::byte{0x7F}));
    ASSERT_TRUE(tracks());
  }
  EXPECT_TRUE(run_until([&] { return status().counters.bad_frames == before.bad_frames + 4; }));
  EXPECT_EQ(status().counters.opened, before.opened);
  EXPECT_EQ(status().counters.restarts, before.restarts);
}

// OSVR HDK.

TEST_F(DriversOnTheBus, TheHdkTracksCountsItsGapsAndDropsWhatItDoesNotKnow) {
  mock::HidrawDevice hdk({0x1532, 0x0b00, "OSVR HDK", "K1", "2-2", 0});
  ASSERT_NO_FATAL_FAILURE(open("driver = \"osvr-hdk\"\nposition_m = [1, 2, 3]"));
  hdk.plug();
  std::atomic<bool> ended{false};
  std::thread sender([&] {
    for (int sequence = 0; !ended; sequence += sequence % 50 == 0 ? 2 : 1) {
      std::this_thread::sleep_for(std::chrono::microseconds(2500));
      mock::Bytes report(32);
      report[0] = std::byte{2};
      report[1] = static_cast<std::byte>(sequence & 0xFF);
      report[9] = std::byte{0x40};  // w = 1
      hdk.send(std::move(report));
      if (sequence % 20 == 0) hdk.send(mock::Bytes(16));  // version 0
    }
  });
  EXPECT_TRUE(tracks());
  EXPECT_EQ(newest_.world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(
      run_until([&] { return status().counters.lost >= 2 && status().counters.bad_frames >= 2; }));
  EXPECT_EQ(status().counters.opened, 1U);
  ended = true;
  sender.join();
  tracker_.reset();
}

}  // namespace
}  // namespace veneer::tracking
