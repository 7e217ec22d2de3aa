// SPDX-License-Identifier: Apache-2.0
// veneer status, tell and doctor, run as a person runs them, against a service on a bus of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "service/bus/bus_server.h"
#include "service/bus/testing/private_bus.h"
#include "service/testing/fake_control.h"
#include "tests/program.h"

namespace veneer {
namespace {

using namespace std::chrono_literals;
using service::State;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class ServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    const Status started = bus_.start();
    ASSERT_TRUE(started) << started.error().what;
    service::BusOptions options;
    options.address = bus_.address();
    auto server = service::BusServer::start(control_, options);
    ASSERT_TRUE(server) << server.error().what;
    server_ = std::move(*server);
    control_.change([](service::ServiceStatus& s) {
      s = service::busy_status();
      s.faults.front().since = SteadyClock().now() - 65s;
    });
  }
  [[nodiscard]] std::string option() const { return "--bus " + bus_.address().text(); }

  TemporaryFolder folder_;
  service::PrivateBus bus_{{service::open_policy(folder_.path())}};
  service::FakeControl control_;
  std::unique_ptr<service::BusServer> server_;
};

TEST_F(ServiceTest, StatusSaysAllAndEndsByTheState) {
  const Outcome degraded = run("veneer status " + option());
  EXPECT_EQ(degraded.exit_code, 3);
  EXPECT_EQ(degraded.err, "");
  for (const char* each : {"degraded",
                           "tracker for 1 min: waiting for poses",
                           "leather.safetensors",
                           "hydra: silent",
                           "59.9 a second",
                           "gpu_draw"})
    EXPECT_THAT(degraded.out, HasSubstr(each));
  for (const auto& [state, code] :
       {std::pair{State::kRunning, 0}, std::pair{State::kBlank, 3}, std::pair{State::kFault, 3}}) {
    control_.change([&, to = state](service::ServiceStatus& s) { s.state = to; });
    EXPECT_EQ(run("veneer status " + option()).exit_code, code) << name_of(state);
  }
}

TEST_F(ServiceTest, StatusIsOneObjectForPrograms) {
  const Outcome outcome = run("veneer status --json " + option());
  EXPECT_EQ(outcome.exit_code, 3);
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json.at("state"), "degraded");
  EXPECT_EQ(json.at("faults").at(0).at("kind"), "tracker");
  EXPECT_NEAR(json.at("faults").at(0).at("age_s").get<double>(), 65, 20);
  EXPECT_EQ(json.at("latency_ms").at("tracker"), 0.25);
}

TEST_F(ServiceTest, StatusSaysWhereToLookWhenThereIsNoService) {
  server_.reset();
  EXPECT_TRUE(fails(run("veneer status " + option()), 1, "systemctl status veneerd"));
  EXPECT_TRUE(fails(run("veneer tell blank " + option()), 1, "[service]"));
  bus_.stop();
  EXPECT_TRUE(fails(run("veneer status " + option()), 1, "dbus-daemon"));
  EXPECT_TRUE(fails(run("veneer status --bus sytem"), 2, "is no message bus"));
}

/// What veneer doctor says, as an object, with its exit code held against it: 0 where the tools can
/// be used, however the service is.
nlohmann::json doctor(const std::string& options) {
  const Outcome outcome = run("veneer doctor --json --quiet " + options);
  auto json = nlohmann::json::parse(outcome.out);
  bool usable = json.at("gl_usable").get<bool>();
  for (const auto& tracker : json.at("trackers")) usable = usable && tracker.at("usable");
  EXPECT_EQ(outcome.exit_code, usable ? 0 : 1) << outcome.out;
  EXPECT_EQ(outcome.err, "");
  return json;
}

TEST_F(ServiceTest, DoctorLooksAtTheServiceAndAtAllThatItNeeds) {
  const auto json = doctor(option());
  EXPECT_EQ(json.at("service"), nlohmann::json({{"running", true}, {"state", "degraded"}}));
  EXPECT_GE(json.at("threads").get<int>(), 1);
  EXPECT_TRUE(json.at("connectors_problem").get<std::string>().empty() ||
              json.at("connectors").empty());

  const Outcome text = run("veneer doctor " + option());
  EXPECT_THAT(text.out, HasSubstr(json.at("gl").get<std::string>()));
  EXPECT_THAT(text.out, HasSubstr("BLAS     " + json.at("blas").get<std::string>()));
  EXPECT_THAT(text.out, HasSubstr("\nservice  degraded"));
  EXPECT_THAT(text.err, HasSubstr("cameras")) << "which take a second";
  // One line at least of each, whether there is one or none.
  for (const char* kind :
       {"tracker", "colorimeter", "camera", "light engine", "display", "connector"})
    EXPECT_THAT(text.out, HasSubstr(fmt::format("\n{}  ", kind)));
}

TEST_F(ServiceTest, DoctorSaysWhyTheServiceCannotBeAskedAndGoesOn) {
  server_.reset();
  const auto service = doctor(option()).at("service");
  EXPECT_EQ(service.at("running"), false);
  EXPECT_THAT(service.at("problem").get<std::string>(), HasSubstr("systemctl status veneerd"));
  EXPECT_TRUE(fails(run("veneer doctor --bus sytem"), 2, "is no message bus"));
}

TEST_F(ServiceTest, TellHasEverythingDone) {
  for (const char* each : {"blank", "unblank", "reload", "scene /s.toml"})
    EXPECT_EQ(run(fmt::format("veneer tell {} {}", option(), each)).exit_code, 0) << each;
  EXPECT_EQ(run("veneer tell light 2 -0.5,-1,2.5 750 " + option()).exit_code, 0);
  EXPECT_EQ(run("veneer tell light 0 1,0,0 5 --colour 1,0.5,0 " + option()).exit_code, 0);
  const Outcome snapshot = run("veneer tell snapshot " + option());
  EXPECT_EQ(snapshot.out, "/var/lib/veneer/snapshot.png\n");
  EXPECT_EQ(run("veneer tell material a/../b.safetensors " + option()).exit_code, 0);
  EXPECT_THAT(
      control_.told(),
      ElementsAre("blank",
                  "unblank",
                  "reload",
                  "scene /s.toml",
                  "light 2 -0.5 -1 2.5 750 1 1 1",
                  "light 0 1 0 0 5 1 0.5 0",
                  "snapshot",
                  "material " + (std::filesystem::current_path() / "b.safetensors").string()));
}

TEST_F(ServiceTest, TellSaysWhyItIsRefused) {
  control_.refuse_with(Error{Errc::kNotFound, "loading /x: no such file"});
  EXPECT_TRUE(fails(run("veneer tell material /x " + option()), 1, "loading /x: no such file"));
  EXPECT_TRUE(fails(run("veneer tell light 0 0,0,0 5 " + option()), 2, "direction"));
  for (const char* each : {"0,0", "0,0,1,", "0,0,1,1", ",0,1", "a,b,c", "0;0;1", "''"})
    EXPECT_TRUE(fails(run(fmt::format("veneer tell light 0 \"{}\" 5 {}", each, option())),
                      2,
                      "is not three numbers"))
        << each;
  EXPECT_TRUE(fails(run("veneer tell light 0 0,0,1 nan " + option()), 2, "lux"));
  EXPECT_TRUE(fails(run("veneer tell light -- -1 0,0,1 5 " + option()), 2, ""));
  EXPECT_TRUE(fails(run("veneer tell dance " + option()), 2, "there is no \"dance\"; say what"));
  EXPECT_TRUE(fails(run("veneer tell"), 2, "veneer tell: say what to do: blank, unblank, "));
  EXPECT_TRUE(fails(run("veneer tell light 0"), 2, "veneer tell light --help"));
  // A mistake is told before it is asked whether there is a service.
  EXPECT_TRUE(fails(run("veneer tell light 0 0,0,0 5 --bus unix:path=/nowhere"), 2, "direction"));
  EXPECT_THAT(control_.told(), ElementsAre("material /x"));
}

/// veneer status --watch on a terminal or a pipe, ended by Ctrl-C.
struct Watched {
  std::string text;
  int exit_code = -1;
};
Watched watch(const std::string& address, bool terminal, const std::function<void()>& meanwhile) {
  int from = -1;
  pid_t child = -1;
  const std::string program = std::string(VENEER_PROGRAMS) + "/veneer";
  const auto become = [&] {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
    ::execl(program.c_str(), "veneer", "status", "--watch", "--bus", address.c_str(), nullptr);
    ::_exit(127);
  };
  if (terminal) {
    child = ::forkpty(&from, nullptr, nullptr, nullptr);
    if (child == 0) become();
  } else {
    int ends[2] = {-1, -1};
    VENEER_CHECK(::pipe(ends) == 0);
    child = ::fork();
    if (child == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::close(ends[0]);
      ::close(ends[1]);
      become();
    }
    ::close(ends[1]);
    from = ends[0];
  }
  Watched watched;
  bool done = false;
  bool interrupted = false;
  for (const Time end = SteadyClock().now() + 30s; SteadyClock().now() < end;) {
    pollfd readable{from, POLLIN, 0};
    if (::poll(&readable, 1, 100) <= 0) continue;
    char buffer[4096];
    const ssize_t size = ::read(from, buffer, sizeof buffer);
    if (size <= 0) break;
    watched.text.append(buffer, static_cast<std::size_t>(size));
    if (!done && watched.text.find("degraded") != std::string::npos) {
      meanwhile();
      done = true;
    }
    if (!interrupted && watched.text.find("running") != std::string::npos) {
      if (terminal) {
        EXPECT_EQ(::write(from, "\x03", 1), 1);  // as the key does
      } else {
        ::kill(child, SIGINT);
      }
      interrupted = true;
    }
  }
  ::close(from);
  int status = 0;
  ::waitpid(child, &status, 0);
  watched.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return watched;
}

TEST_F(ServiceTest, WatchRedrawsInPlaceOnATerminalOnly) {
  for (const bool terminal : {true, false}) {
    control_.change([](service::ServiceStatus& s) { s.state = State::kDegraded; });
    const Watched watched = watch(bus_.address().text(), terminal, [&] {
      control_.change([](service::ServiceStatus& s) { s.state = State::kRunning; });
    });
    EXPECT_EQ(watched.exit_code, 0) << watched.text;
    EXPECT_THAT(watched.text, HasSubstr("degraded"));
    EXPECT_EQ(watched.text.find('\033') != std::string::npos, terminal) << watched.text;
  }
}

}  // namespace
}  // namespace veneer
