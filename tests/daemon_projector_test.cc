// SPDX-License-Identifier: Apache-2.0
// The daemon as it is, beside a PJLink projector on the loopback, seen over a bus of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "base/testing/temporary_folder.h"
#include "btf/models/internal_test_models.h"
#include "calibration/profile_store.h"
#include "projector/control/pjlink/fake_projector.h"
#include "projector/control/pjlink/pjlink.h"
#include "render/internal_testing.h"
#include "service/bus/bus_client.h"
#include "service/bus/testing/private_bus.h"
#include "tests/daemon_child.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using projector::pjlink::FakeProjector;
using service::FaultKind;
using service::ServiceStatus;
using service::State;
using ::testing::HasSubstr;

/// The least that the daemon takes for a projector on the network, and what a busy machine adds.
constexpr auto kPoll = 10s;
constexpr auto kSlack = 10s;

std::optional<service::Fault> fault_of(const ServiceStatus& status, FaultKind kind) {
  const auto found = std::ranges::find(status.faults, kind, &service::Fault::kind);
  return found == status.faults.end() ? std::nullopt : std::optional(*found);
}

class DaemonBesideAProjector : public ::testing::Test {
 protected:
  void SetUp() override {
    const Status started = bus_.start();
    ASSERT_TRUE(started) << started.error().what;
    projector_ = std::make_unique<FakeProjector>(FakeProjector::well());
    port_ = projector_->port();
    const btf::SampleSet set = btf::testing::dichromatic_set(at("set.btfset"), false);
    const auto material = btf::testing::fit("phong", set, {});
    ASSERT_TRUE(material) << material.error().what;
    ASSERT_TRUE(btf::save_material(**material, at("material.safetensors"), {}));
    calibration::ProjectorProfile profile = render::example_profile(8, 6, 8);
    profile.record = record_of_now();
    ASSERT_TRUE(calibration::ProfileStore(at("profile")).publish(profile));
    ASSERT_TRUE(write_text(at("scene.toml"),
                           "mesh = \"sphere\"\n[observer]\ntracker_body = 0\n[[light]]\nkind = "
                           "\"directional\"\ndirection = [0, 0, 1]\nilluminance_lux = 300\n"));
    ASSERT_TRUE(write_text(at("veneer.toml"),
                           fmt::format(R"(scene = "scene.toml"
material = "material.safetensors"
profile = "profile"
state_directory = "state"
clock = "monotonic"
frame_rate_hz = 5
frames = 0
first_pose_timeout_s = 60
[service]
bus = "{}"
[control]
driver = "pjlink"
host = "localhost"
port = {}
poll_s = {}
[tracker]
driver = "simulated"
rate_hz = 60
[[tracker.path]]
body = 0
kind = "walk"
centre = [0.0, 0.0, 0.0]
radius_m = 0.9
height_m = 0.2
from_deg = -25
to_deg = 45
period_s = 8
[output]
driver = "null"
)",
                                       bus_.address().text(),
                                       port_,
                                       kPoll.count())));
  }
  [[nodiscard]] fs::path at(const std::string& name) const { return folder_.path() / name; }
  /// As the calibration keeps it with a profile.
  [[nodiscard]] projector::ControlRecord record_of_now() const {
    projector::PjlinkOptions options;
    options.host = "127.0.0.1";
    options.port = port_;
    SteadyClock clock;
    const auto state = projector::Pjlink(options, clock).read_state();
    EXPECT_TRUE(state) << state.error().what;
    return state ? to_record(*state) : projector::ControlRecord{};
  }
  /// What the bus says once `is_it` likes it, or last.
  ServiceStatus status_when(const std::function<bool(const ServiceStatus&)>& is_it,
                            std::chrono::nanoseconds patience) {
    ServiceStatus last;
    static_cast<void>(wait_until(
        [&] {
          std::this_thread::sleep_for(50ms);
          auto client = service::BusClient::connect(bus_.address());
          if (!client) return false;
          const auto status = client->status();
          if (!status) return false;
          last = *status;
          return is_it(last);
        },
        patience));
    return last;
  }

  TemporaryFolder folder_;
  service::PrivateBus bus_{{service::open_policy(folder_.path())}};
  std::unique_ptr<FakeProjector> projector_;
  int port_ = 0;
};

TEST_F(DaemonBesideAProjector, TellsWhatItSaysWhatChangedAndThatItIsGoneUntilItIsNot) {
  // Since the profile was measured somebody has turned to another input and put in another lamp.
  projector_->reply("%2INPT ?\r", "%2INPT=32\r");
  projector_->reply("%1LAMP ?\r", "%1LAMP=3 1\r");
  Daemon daemon({"--config", at("veneer.toml").string()}, at("veneerd.log"));
  const auto has = [](FaultKind kind) {
    return [kind](const ServiceStatus& s) { return fault_of(s, kind).has_value(); };
  };
  const auto has_not = [](FaultKind kind) {
    return [kind](const ServiceStatus& s) {
      return s.state != State::kStarting && !fault_of(s, kind);
    };
  };
  const auto changed = status_when(has(FaultKind::kProjectorState), 60s);
  ASSERT_TRUE(fault_of(changed, FaultKind::kProjectorState)) << daemon.log();
  EXPECT_THAT(changed.projector, HasSubstr("on, input digital2, lamp 3 h"));
  const std::string text = fault_of(changed, FaultKind::kProjectorState)->text;
  EXPECT_THAT(text, HasSubstr("the input was \"digital1\" and is \"digital2\""));
  EXPECT_THAT(text, HasSubstr("lamp 1 was replaced"));
  EXPECT_FALSE(fault_of(changed, FaultKind::kProjector));

  const FakeProjector::Behaviour well = FakeProjector::well();
  for (const char* request : {"%2INPT ?\r", "%1LAMP ?\r"})
    projector_->reply(request, well.replies.at(request));
  const auto set_back = status_when(has_not(FaultKind::kProjectorState),
                                    service::recovery_time_of(FaultKind::kProjectorState));
  EXPECT_FALSE(fault_of(set_back, FaultKind::kProjectorState)) << set_back.projector;
  EXPECT_THAT(set_back.projector, HasSubstr("on, input digital1, lamp 1234 h"));

  projector_.reset();
  const auto gone = status_when(has(FaultKind::kProjector), kPoll + kSlack);
  ASSERT_TRUE(fault_of(gone, FaultKind::kProjector)) << daemon.log();
  EXPECT_THAT(fault_of(gone, FaultKind::kProjector)->text, HasSubstr("nobody listens there"));
  EXPECT_EQ(gone.projector, fault_of(gone, FaultKind::kProjector)->text);
  EXPECT_EQ(gone.state, State::kDegraded);

  projector_ = std::make_unique<FakeProjector>(FakeProjector::well(), port_);
  const auto back =
      status_when(has_not(FaultKind::kProjector), service::recovery_time_of(FaultKind::kProjector));
  EXPECT_FALSE(fault_of(back, FaultKind::kProjector)) << back.projector;
  EXPECT_FALSE(fault_of(back, FaultKind::kProjectorState));
  EXPECT_THAT(back.projector, HasSubstr("on, input digital1"));
  EXPECT_EQ(daemon.stop(), 0) << daemon.log();
}

}  // namespace
}  // namespace veneer
