// SPDX-License-Identifier: Apache-2.0
#include "service/front.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "base/testing/temporary_folder.h"
#include "base/unique_handle.h"
#include "service/bus/bus_client.h"
#include "service/bus/testing/private_bus.h"
#include "service/metrics/metrics.h"
#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

template <class Condition>
bool eventually(const Condition& holds) {
  const Time end = SteadyClock().now() + 20s;
  while (!holds()) {
    if (SteadyClock().now() > end) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

TEST(Front, OffersNothingThatNobodyAskedFor) {
  FakeControl control;
  const auto front = Front::start(control, {});
  std::this_thread::sleep_for(100ms);
  EXPECT_EQ(control.times_asked(), 0U);
  EXPECT_TRUE(control.told().empty());
}

TEST(Front, ReloadsWhenItIsAskedToAndOnlyThen) {
  FakeControl control;
  std::atomic<bool> requested{false};
  FrontOptions options;
  options.reload_requested = &requested;
  const auto front = Front::start(control, options);
  for (int i = 1; i <= 2; ++i) {
    control.refuse_with(i == 1 ? std::optional(Error{Errc::kBadFormat, "line 3"}) : std::nullopt);
    requested = true;
    ASSERT_TRUE(eventually([&] { return control.told().size() == static_cast<std::size_t>(i); }));
    EXPECT_FALSE(requested);
  }
  std::this_thread::sleep_for(250ms);
  EXPECT_THAT(control.told(), ElementsAre("reload", "reload"));
}

TEST(Front, GoesOnWithoutWhatCannotBeHad) {
  FakeControl control;
  const auto taken = MetricsPort::open(control, 0);
  ASSERT_TRUE(taken);
  std::atomic<bool> requested{true};
  FrontOptions options;
  options.bus = "unix:path=/proc/none/bus";
  options.metrics_port = (*taken)->port();
  options.metrics_file = "/proc/none/veneer.prom";
  options.reload_requested = &requested;
  const auto front = Front::start(control, options);
  EXPECT_TRUE(eventually([&] { return !control.told().empty(); })) << "the rest of it works";
}

/// A port of the loopback that was free a moment ago.
int free_port() {
  const UniqueFd socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  EXPECT_EQ(::bind(socket.value(), reinterpret_cast<const sockaddr*>(&address), size), 0);
  EXPECT_EQ(::getsockname(socket.value(), reinterpret_cast<sockaddr*>(&address), &size), 0);
  return ntohs(address.sin_port);
}

/// What Prometheus is told there; nothing where nobody listens.
std::string scrape(int port) {
  const UniqueFd socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  if (::connect(socket.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return "";
  const std::string question = "GET /metrics HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
  EXPECT_EQ(::send(socket.value(), question.data(), question.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(question.size()));
  std::string answer;
  char buffer[4096];
  for (ssize_t got = 0; (got = ::recv(socket.value(), buffer, sizeof(buffer), 0)) > 0;)
    answer.append(buffer, static_cast<std::size_t>(got));
  return answer;
}

TEST(Front, AnswersPrometheusOnThePortThatItIsGiven) {
  FakeControl control;
  control.change([](ServiceStatus& s) { s.state = State::kBlank; });
  FrontOptions options;
  options.metrics_port = free_port();
  auto front = Front::start(control, options);
  EXPECT_THAT(scrape(options.metrics_port), HasSubstr("veneer_state{state=\"blank\"} 1"));
  front.reset();
  EXPECT_EQ(scrape(options.metrics_port), "");
}

TEST(Front, OffersAllOfItAndTellsSystemdOfAReloadByTheBus) {
  const TemporaryFolder folder;
  PrivateBus bus{{open_policy(folder.path())}};
  ASSERT_TRUE(bus.start());
  const std::string path = (folder.path() / "notify").string();
  const UniqueFd socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  ASSERT_EQ(::bind(socket.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)),
            0);
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);

  FakeControl control;
  control.change([](ServiceStatus& s) { s.state = State::kRunning; });
  control.advance(1);
  FrontOptions options;
  options.bus = bus.address().text();
  options.metrics_file = folder.path() / "veneer.prom";
  EXPECT_TRUE(options.check());
  auto front = Front::start(control, options);
  std::vector<std::string> heard;
  const auto hear = [&](const std::string& word) {
    return eventually([&] {
      pollfd readable{socket.value(), POLLIN, 0};
      char buffer[512];
      if (::poll(&readable, 1, 0) == 1)
        heard.emplace_back(buffer, ::recv(socket.value(), buffer, sizeof buffer, 0));
      return !heard.empty() && heard.back().starts_with(word);
    });
  };
  EXPECT_TRUE(hear("READY=1"));
  EXPECT_TRUE(std::filesystem::exists(options.metrics_file));
  BusClient client = BusClient::connect(bus.address()).value();
  EXPECT_EQ(client.status().value().state, State::kRunning);
  EXPECT_TRUE(client.tell(Reload{}));
  EXPECT_TRUE(hear("RELOADING=1"));
  EXPECT_TRUE(hear("READY=1"));
  front.reset();
  EXPECT_TRUE(hear("STOPPING=1"));
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_FALSE(client.status());
  EXPECT_FALSE(std::filesystem::exists(options.metrics_file));
}

TEST(FrontOptions, SayWhichKeyIsWrong) {
  EXPECT_TRUE(FrontOptions{}.check());
  const auto refused = [](const std::function<void(FrontOptions&)>& change) {
    FrontOptions options;
    change(options);
    const Status status = options.check();
    EXPECT_TRUE(!status && status.error().code == Errc::kInvalidOption);
    return status ? "" : status.error().what;
  };
  EXPECT_THAT(refused([](auto& o) { o.bus = "sytem"; }), HasSubstr("service.bus"));
  EXPECT_THAT(refused([](auto& o) { o.metrics_port = 65536; }), HasSubstr("metrics_port"));
  EXPECT_THAT(refused([](auto& o) { o.metrics_port = -1; }), HasSubstr("metrics_port"));
  EXPECT_THAT(refused([](auto& o) { o.metrics_file = "a.prom"; }), HasSubstr("metrics_file"));
  EXPECT_THAT(refused([](auto& o) { o.metrics_file = "/a.txt"; }), HasSubstr("metrics_file"));
}

}  // namespace
}  // namespace veneer::service
