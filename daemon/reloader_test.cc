// SPDX-License-Identifier: Apache-2.0
#include "daemon/reloader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>

#include "daemon/testing/daemon_fixture.h"

namespace veneer::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::vector<std::string> left_of(const std::string& started, const std::string& now) {
  return keys_left_to_a_start(TomlReader::parse(started, "a").value(),
                              TomlReader::parse(now, "b").value());
}

TEST(KeysLeftToAStart, AreAllThatAReloadDoesNotTake) {
  EXPECT_THAT(left_of("", ""), IsEmpty());
  EXPECT_THAT(
      left_of("scene = 'a'\nmaterial = 'a'\nprofile = 'a'\ndisplay_latency_ms = 1\n[render]\n"
              "luminance_ceiling = 1\n[quality]\nrung = 1\n[presence]\nlost_s = 1\n",
              "scene = 'b'\n[render]\nluminance_ceiling = 2\ndither = false\n"),
      IsEmpty());
  EXPECT_THAT(
      left_of("frame_rate_hz = 60\n[tracker]\ndriver = 'vrpn'\nhost = 'a'\n[[tracker.path]]\n"
              "body = 0\n[service]\nbus = 'none'\n",
              "scene = 'b'\n[tracker]\ndriver = 'freed'\n[service]\nbus = 'none'\n[control]\n"
              "driver = 'pjlink'\n"),
      ElementsAre("[control] driver",
                  "frame_rate_hz",
                  "[tracker] driver",
                  "[tracker] host",
                  "[tracker] path"));
  EXPECT_THAT(left_of("[scenario]\nseed = 1\n", "[[expect]]\nmost = 1\n"), IsEmpty());
}

/// The log of a daemon that is told to reload.
class ReloadTest : public testing::DaemonFixture {
 protected:
  void SetUp() override {
    DaemonFixture::SetUp();
    spdlog::default_logger()->sinks().push_back(sink_);
  }
  void TearDown() override { spdlog::default_logger()->sinks().pop_back(); }
  /// What is logged by a reload of this configuration, each after the other.
  std::vector<std::string> logs_of(const std::vector<std::string>& configurations) {
    write_config("");
    std::vector<std::string> logs;
    service::ServiceControl* control = nullptr;
    Devices fakes = devices();
    fakes.before_frame = [&](std::uint64_t number, Time) {
      if (number >= configurations.size()) return;
      write_config(configurations[number]);
      log_.str("");
      const Status reloaded = control->reload();
      EXPECT_TRUE(reloaded) << reloaded.error().what;
      logs.push_back(log_.str());
    };
    auto daemon =
        Daemon::create(at("veneer.toml"), {"clock=\"virtual\"", "frames=20"}, fakes).value();
    control = daemon.get();
    SilentProgress silent;
    const std::atomic<bool> stop{false};
    EXPECT_TRUE(daemon->run(stop, silent));
    return logs;
  }

  std::ostringstream log_;
  spdlog::sink_ptr sink_ = std::make_shared<spdlog::sinks::ostream_sink_st>(log_);
};

TEST_F(ReloadTest, WarnsByNameOfWhatIsTakenAtTheNextStartOnly) {
  const std::string other = "frame_rate_hz = 50\n[tracker]\ndriver = \"vrpn\"\n";
  const auto logs = logs_of(
      {"[render]\nluminance_ceiling = 80\n", "[tracker]\ndriver = \"vrpn\"\n", other, other, ""});
  ASSERT_EQ(logs.size(), 5U);
  EXPECT_THAT(logs[0], Not(HasSubstr("next start")));
  EXPECT_THAT(logs[1],
              HasSubstr("veneer.toml: [tracker] driver differs from what veneerd started with: it "
                        "is taken at the next start: systemctl restart veneerd"));
  EXPECT_THAT(logs[2], HasSubstr("frame_rate_hz, [tracker] driver differ from"));
  EXPECT_THAT(logs[3], HasSubstr("frame_rate_hz, [tracker] driver differ from"))
      << "who asks again is told again";
  EXPECT_THAT(logs[4], Not(HasSubstr("next start"))) << "as it was at the start";
}

}  // namespace
}  // namespace veneer::daemon
