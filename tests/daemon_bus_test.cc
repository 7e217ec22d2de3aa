// SPDX-License-Identifier: Apache-2.0
// The daemon as it is, with a tracker on a mocked USB bus that goes wrong in every way.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "tests/daemon_child.h"
#include "tracking/testing/mock_liberty.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using ::testing::HasSubstr;
using tracking::mock::Liberty;
using tracking::mock::UsbDevice;

/// After the last fault; a few frames, however busy the machine.
constexpr milliseconds kRecovery(3000);
/// The latency of the display, and a frame or two of a software renderer.
constexpr double kFreshPose_ms = 500;

class DaemonOnTheBus : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const std::string here = folder_->path().string();
    const std::string etc = VENEER_ETC;
    for (const std::string& line :
         {"synthesize cloth --size 8 --views 25 --lights 25 --samples 1 -o " + here + "/s.btfset",
          "fit " + here + "/s.btfset --model phong -o " + here + "/material.safetensors",
          "calibrate --yes --board-poses 5 --bench " + etc + "/benches/demo.toml -o " + here +
              "/profile"}) {
      ASSERT_EQ(std::system((VENEER_PROGRAMS "/veneer " + line + " --quiet </dev/null").c_str()), 0)
          << line;
    }
    std::string scene = read_text(fs::path(etc) / "demo" / "scene.toml").value();
    const std::string body = "tracker_body = 0";
    ASSERT_NE(scene.find(body), std::string::npos);
    scene.replace(scene.find(body), body.size(), "tracker_body = 1");
    ASSERT_TRUE(write_text(folder_->path() / "scene.toml", scene));
    ASSERT_TRUE(write_text(folder_->path() / "veneer.toml",
                           read_text(fs::path(etc) / "demo" / "veneer.toml").value()));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  /// Station 1 of a LIBERTY is the observer; few frames, since pictures are not what is looked at.
  static std::vector<std::string> arguments() {
    std::vector<std::string> result{"--config", (folder_->path() / "veneer.toml").string()};
    for (const std::string& setting : {std::string("clock=\"monotonic\""),
                                       std::string("frames=0"),
                                       std::string("frame_rate_hz=5"),
                                       std::string("first_pose_timeout_s=60"),
                                       "frame_log=\"" + frame_log().string() + "\"",
                                       std::string("tracker={driver=\"polhemus\"}"),
                                       std::string("output={driver=\"null\"}")}) {
      result.insert(result.end(), {"--set", setting});
    }
    return result;
  }
  static fs::path log_file() { return folder_->path() / "veneerd.log"; }
  static fs::path frame_log() { return folder_->path() / "frames.csv"; }
  /// How old the pose was that the last frame was made for, in milliseconds.
  static double last_pose_age_ms() {
    const std::string log = read_text(frame_log()).value_or("");
    std::istringstream last_line(log.substr(log.rfind('\n', log.size() - 2) + 1));
    std::string column;  // frame, display_time_ns, frame_ms, gpu_ms, pose_age_ms
    for (int i = 0; i < 5; ++i) std::getline(last_line, column, ',');
    return std::stod(column);
  }

  static inline TemporaryFolder* folder_ = nullptr;
};

/// Whether frames flow from the device to the daemon, now.
bool flows(Liberty& liberty) {
  const std::uint64_t before = liberty.frames();
  return wait_until([&] {
    return liberty.streams() && liberty.frames() > before + 20 && liberty.usb().in_flight() > 0;
  });
}

TEST_F(DaemonOnTheBus, SurvivesUnplugReplugAndAnotherDevicesArrivalAndSaysSo) {
  Liberty liberty;
  {
    Daemon daemon(arguments(), log_file());
    ASSERT_TRUE(daemon.runs());
    liberty.plug();
    ASSERT_TRUE(flows(liberty)) << daemon.log();
    ASSERT_TRUE(daemon.says("running")) << daemon.log();
    std::this_thread::sleep_for(kRecovery);  // the rasteriser's threads come with the first frames
    const std::size_t descriptors = daemon.descriptors();
    const std::size_t threads = daemon.threads();
    UsbDevice mouse({0x046d, 0xc077, "Mouse", "", "1-4", {{0x81, true}}});
    for (int i = 0; i < 5; ++i) {
      liberty.unplug();
      mouse.plug();
      std::this_thread::sleep_for(milliseconds(50 * i));
      EXPECT_TRUE(daemon.runs());
      mouse.unplug();
      liberty.plug();
      ASSERT_TRUE(flows(liberty)) << daemon.log();
    }
    EXPECT_EQ(daemon.descriptors(), descriptors);
    EXPECT_EQ(daemon.threads(), threads);
    std::this_thread::sleep_for(kRecovery);
    EXPECT_EQ(daemon.stop(), 0) << daemon.log();
    EXPECT_LE(last_pose_age_ms(), kFreshPose_ms);
    EXPECT_THAT(daemon.log(), HasSubstr("absent"));
    EXPECT_THAT(daemon.log(), HasSubstr("tracking"));
  }
}

TEST_F(DaemonOnTheBus, SurvivesTenThousandFaultsWithoutALeak) {
  constexpr int kFaults = 10'000;
  constexpr int kWarmUp = 1'000;  // what grows once, has grown then
  constexpr double kGrowth_MiB = 8;
  Liberty liberty;
  {
    Daemon daemon(arguments(), log_file());
    liberty.plug();
    ASSERT_TRUE(flows(liberty)) << daemon.log();
    Pcg32 random(2026);
    std::size_t descriptors = 0;
    std::size_t threads = 0;
    double resident_mib = 0;
    for (int i = 0; i < kFaults; ++i) {
      // A fault is one only while somebody listens.
      const auto listens = [&liberty] { return liberty.usb().in_flight() > 0; };
      ASSERT_TRUE(wait_until(listens)) << "after fault " << i << "\n" << daemon.log();
      inject_random_fault(random, liberty);
      std::this_thread::sleep_for(milliseconds(1));
      if (i != kWarmUp) continue;
      ASSERT_TRUE(flows(liberty)) << daemon.log();
      descriptors = daemon.descriptors();
      threads = daemon.threads();
      resident_mib = daemon.resident_mib();
    }
    EXPECT_TRUE(flows(liberty)) << daemon.log();
    EXPECT_EQ(daemon.descriptors(), descriptors);
    EXPECT_EQ(daemon.threads(), threads);
    EXPECT_LE(daemon.resident_mib(), resident_mib + kGrowth_MiB);
    std::this_thread::sleep_for(kRecovery);
    EXPECT_EQ(daemon.stop(), 0) << daemon.log();
    EXPECT_LE(last_pose_age_ms(), kFreshPose_ms) << "nothing that was said falsely lasts";
    EXPECT_THAT(daemon.log(), HasSubstr("absent"));
  }
}

}  // namespace
}  // namespace veneer
