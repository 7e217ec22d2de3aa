// SPDX-License-Identifier: Apache-2.0
#include "service/metrics/metrics.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <thread>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "base/unique_handle.h"
#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// Prometheus' text format 0.0.4, read strictly.
struct Scrape {
  std::map<std::string, double> values;      // by name{labels}
  std::map<std::string, std::string> types;  // by name
};

Scrape parse(const std::string& text) {
  static const std::regex kSample(
      R"(([a-z_]+)(\{[a-z]+="(?:[^"\\\n]|\\.)*"(?:,[a-z]+="(?:[^"\\\n]|\\.)*")*\})? (\S+))");
  static const std::regex kComment(R"(# (HELP|TYPE) ([a-z_]+) (.+))");
  Scrape scrape;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("exposer_") != std::string::npos) continue;  // the library's, of itself
    std::smatch match;
    if (std::regex_match(line, match, kComment)) {
      if (match[1] == "TYPE") scrape.types[match[2]] = match[3];
    } else if (std::regex_match(line, match, kSample)) {
      EXPECT_TRUE(scrape.types.contains(match[1])) << "no type before: " << line;
      EXPECT_TRUE(
          scrape.values.emplace(match[1].str() + match[2].str(), std::stod(match[3])).second)
          << "twice: " << line;
    } else {
      ADD_FAILURE() << "no line of the format: " << line;
    }
  }
  return scrape;
}

/// What an HTTP server answers; empty where nobody listens.
std::string ask(const in_addr& host, int port, const std::string& target) {
  const UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr = host;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  if (::connect(fd.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    return {};
  const std::string request =
      fmt::format("GET {} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", target);
  EXPECT_EQ(::write(fd.value(), request.data(), request.size()),
            static_cast<ssize_t>(request.size()));
  std::string answer;
  char buffer[4096];
  for (ssize_t n = 0; (n = ::read(fd.value(), buffer, sizeof buffer)) > 0;)
    answer.append(buffer, static_cast<std::size_t>(n));
  return answer;
}

const in_addr kLoopback{htonl(INADDR_LOOPBACK)};

Scrape scrape(int port) {
  const std::string answer = ask(kLoopback, port, "/metrics");
  EXPECT_THAT(answer, testing::StartsWith("HTTP/1.1 200"));
  return parse(answer.substr(std::min(answer.find("\r\n\r\n") + 4, answer.size())));
}

void expect_busy(const Scrape& s) {
  const ServiceStatus status = busy_status();
  EXPECT_EQ(s.values.at("veneer_state{state=\"degraded\"}"), 1);
  EXPECT_EQ(s.values.at("veneer_state{state=\"running\"}"), 0);
  EXPECT_EQ(s.values.at("veneer_fault{kind=\"tracker\"}"), 1);
  EXPECT_EQ(s.values.at("veneer_fault{kind=\"disk\"}"), 1);
  EXPECT_EQ(s.values.at("veneer_fault{kind=\"gpu\"}"), 0);
  EXPECT_EQ(s.values.at("veneer_frames_total"), 123456789012345.0);
  EXPECT_EQ(s.values.at("veneer_frames_dropped_total"), 3);
  EXPECT_EQ(s.values.at("veneer_frames_late_total"), 5);
  EXPECT_EQ(s.values.at("veneer_faults_recovered_total"), 7);
  EXPECT_DOUBLE_EQ(s.values.at("veneer_frame_rate_hertz"), 59.94);
  EXPECT_DOUBLE_EQ(s.values.at("veneer_frame_seconds{quantile=\"0.5\"}"), 4.25e-3);
  EXPECT_DOUBLE_EQ(s.values.at("veneer_frame_seconds{quantile=\"0.95\"}"), 6.5e-3);
  EXPECT_DOUBLE_EQ(s.values.at("veneer_gpu_seconds"), 2.125e-3);
  for (const LatencyStage& stage : kLatencyStages)
    EXPECT_DOUBLE_EQ(s.values.at(fmt::format("veneer_latency_seconds{{stage=\"{}\"}}", stage.name)),
                     status.latency_ms.*stage.milliseconds * 1e-3);
}

TEST(Metrics, HoldTheStatusInBaseUnits) {
  ServiceStatus status = busy_status();
  status.frames = 123456789012345;
  expect_busy(parse(metrics_text(status)));
}

TEST(Metrics, AreInExactlyOneState) {
  for (std::size_t i = 0; i < kStateCount; ++i) {
    ServiceStatus status;
    status.state = static_cast<State>(i);
    double sum = 0;
    std::size_t count = 0;
    for (const auto& [name, value] : parse(metrics_text(status)).values)
      if (name.starts_with("veneer_state{")) sum += value, ++count;
    EXPECT_EQ(sum, 1);
    EXPECT_EQ(count, kStateCount);
  }
}

TEST(Metrics, HaveTheSameSeriesWhateverHappens) {
  const auto names_of = [](const ServiceStatus& status) {
    std::set<std::string> names;
    for (const auto& [name, value] : parse(metrics_text(status)).values)
      if (!name.starts_with("veneer_info")) names.insert(name);
    return names;
  };
  EXPECT_EQ(names_of(ServiceStatus{}), names_of(busy_status()));
}

TEST(Metrics, AreNamedByPrometheusRules) {
  for (const auto& [name, type] : parse(metrics_text(busy_status())).types) {
    EXPECT_TRUE(name.starts_with("veneer_")) << name;
    EXPECT_EQ(type == "counter", name.ends_with("_total")) << name << " is a " << type;
    EXPECT_EQ(name.find("milli"), std::string::npos) << name;
  }
}

TEST(Metrics, StandWhatIsNoTextAndNoNumber) {
  ServiceStatus status;
  status.material = "/m/\"quoted\\\"\n\xff{}";
  status.frame_rate_hz = std::numeric_limits<double>::quiet_NaN();
  status.frame_ms_p95 = std::numeric_limits<double>::infinity();
  const Scrape s = parse(metrics_text(status));
  EXPECT_TRUE(std::isnan(s.values.at("veneer_frame_rate_hertz")));
  EXPECT_TRUE(std::isinf(s.values.at("veneer_frame_seconds{quantile=\"0.95\"}")));
}

TEST(MetricsPort, AnswersWithTheStatusOfTheMoment) {
  FakeControl control;
  const auto port = MetricsPort::open(control, 0);
  ASSERT_TRUE(port) << port.error().what;
  ASSERT_GT((*port)->port(), 0);
  EXPECT_EQ(scrape((*port)->port()).values.at("veneer_state{state=\"starting\"}"), 1);
  control.change([](ServiceStatus& s) { s = busy_status(); });
  control.advance(123456789012345);
  expect_busy(scrape((*port)->port()));
  EXPECT_THAT(ask(kLoopback, (*port)->port(), "/etc/passwd"), HasSubstr("404"));
}

TEST(MetricsPort, ListensOnLoopbackAlone) {
  FakeControl control;
  const auto port = MetricsPort::open(control, 0);
  ASSERT_TRUE(port);
  ifaddrs* interfaces = nullptr;
  ASSERT_EQ(::getifaddrs(&interfaces), 0);
  int others = 0;
  for (const ifaddrs* each = interfaces; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != AF_INET) continue;
    const in_addr host = reinterpret_cast<const sockaddr_in*>(each->ifa_addr)->sin_addr;
    if (host.s_addr == kLoopback.s_addr) continue;
    ++others;
    EXPECT_EQ(ask(host, (*port)->port(), "/metrics"), "") << each->ifa_name;
  }
  ::freeifaddrs(interfaces);
  if (others == 0) {
    const in_addr second{htonl(INADDR_LOOPBACK + 1)};
    EXPECT_EQ(ask(second, (*port)->port(), "/metrics"), "");
  }
}

TEST(MetricsPort, SaysThatItIsTaken) {
  FakeControl control;
  const auto first = MetricsPort::open(control, 0);
  ASSERT_TRUE(first);
  const auto second = MetricsPort::open(control, (*first)->port());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kUnavailable);
  EXPECT_THAT(second.error().what, HasSubstr("service.metrics_port"));
  EXPECT_FALSE(scrape((*first)->port()).values.empty());
}

TEST(MetricsPort, RefusesWhatIsNoPort) {
  FakeControl control;
  for (const int port : {-1, 65536, std::numeric_limits<int>::max()}) {
    const auto opened = MetricsPort::open(control, port);
    ASSERT_FALSE(opened) << port;
    EXPECT_EQ(opened.error().code, Errc::kInvalidOption);
  }
}

TEST(MetricsFile, IsWholeWheneverItIsReadAndGoneAtTheEnd) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "veneer.prom";
  FakeControl control;
  auto file = MetricsFile::open(control, path, 1ms);
  ASSERT_TRUE(file) << file.error().what;
  const std::size_t series = parse(read_text(path).value()).values.size();
  std::set<double> seen;
  for (const Time end = SteadyClock().now() + 20s; seen.size() < 20 && SteadyClock().now() < end;) {
    control.advance(1);
    const Scrape s = parse(read_text(path).value());
    ASSERT_EQ(s.values.size(), series);
    seen.insert(s.values.at("veneer_frames_total"));
  }
  EXPECT_GE(seen.size(), 20U) << "it is written again and again";
  file->reset();
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "nothing is left, staged or not";
}

TEST(MetricsFile, IsWrittenAgainOnceItsFolderIsBack) {
  const TemporaryFolder folder;
  const std::filesystem::path sub = folder.path() / "collector";
  FakeControl control;
  const auto file = MetricsFile::open(control, sub / "v.prom", 2ms);
  ASSERT_TRUE(file) << file.error().what;
  // A file takes the folder's place; the writer makes the folder anew if it is quicker.
  const std::filesystem::path blocker = folder.path() / "blocker";
  ASSERT_TRUE(write_text(blocker, "in the way"));
  std::error_code taken;
  int moved = 0;
  do {
    std::error_code ignored;
    std::filesystem::rename(sub, folder.path() / fmt::format("old{}", moved++), ignored);
    std::filesystem::rename(blocker, sub, taken);
  } while (taken && moved < 1000);
  ASSERT_FALSE(taken) << taken.message();
  std::this_thread::sleep_for(20ms);
  std::filesystem::rename(sub, blocker);
  bool back = false;
  for (const Time end = SteadyClock().now() + 20s; !back && SteadyClock().now() < end;)
    back = std::filesystem::exists(sub / "v.prom");
  EXPECT_TRUE(back);
}

TEST(MetricsFile, RefusesANameThatNobodyWouldRead) {
  FakeControl control;
  for (const char* path : {"veneer.prom", "/tmp/veneer.txt", "", "/"}) {
    const auto file = MetricsFile::open(control, path);
    ASSERT_FALSE(file) << path;
    EXPECT_EQ(file.error().code, Errc::kInvalidOption);
  }
  const auto nowhere = MetricsFile::open(control, "/proc/none/veneer.prom");
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, Errc::kIo);
}

}  // namespace
}  // namespace veneer::service
