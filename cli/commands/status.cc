// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "cli/service/status_text.h"
#include "service/bus/bus_client.h"

namespace veneer::cli {
namespace {

using service::BusClient;
using service::ServiceStatus;

constexpr Duration kWatchPeriod = std::chrono::seconds(1);
/// Ctrl-C is seen within this.
constexpr Duration kNap = std::chrono::milliseconds(50);

std::atomic<bool> g_interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

Result<ServiceStatus> ask(const service::BusAddress& address) {
  VENEER_ASSIGN(BusClient client, BusClient::connect(address));
  return client.status();
}

void show(const std::string& text, bool terminal, std::size_t& height) {
  // Up by as many lines as were written before, and all below is wiped.
  if (terminal && height > 0) fmt::print("\033[{}A\033[J", height);
  fmt::print("{}\n", text);
  std::fflush(stdout);
  height = static_cast<std::size_t>(std::ranges::count(text, '\n')) + 1;
}

/// Until Ctrl-C: in place on a terminal, else a line each second; one JSON object each second with
/// --json. A service that goes away and comes back is shown so.
Result<int> watch(CommandLine& line, const service::BusAddress& address) {
  struct sigaction action {};
  action.sa_handler = [](int) { g_interrupted = true; };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  const bool terminal = !line.json() && ::isatty(STDOUT_FILENO) == 1;
  SteadyClock clock;
  std::size_t height = 0;
  Result<ServiceStatus> status = ask(address);
  for (Time next = clock.now(); !g_interrupted;) {
    const Time now = clock.now();
    if (now < next) {
      clock.sleep_until(std::min(next, now + kNap));
      continue;
    }
    next = now + kWatchPeriod;
    status = ask(address);
    if (line.json()) {
      show(status ? json_of(*status, now).dump()
                  : nlohmann::ordered_json{{"error", status.error().what}}.dump(),
           false,
           height);
    } else if (!status) {
      show(status.error().what, terminal, height);
    } else {
      show(terminal ? table_of(*status, now) : line_of(*status, now), terminal, height);
    }
  }
  if (!status) return tl::unexpected(status.error());
  return exit_code_of(*status);
}

}  // namespace

Result<int> run_status(CommandLine& line) {
  std::string bus = "system";
  bool watching = false;
  line.app()
      .add_option("--bus", bus, "system, session or an address such as unix:path=/run/bus")
      ->capture_default_str();
  line.app().add_flag("--watch", watching, "Again every second, until Ctrl-C");
  line.parse();
  VENEER_ASSIGN(const service::BusAddress address, service::BusAddress::parse(bus));
  if (watching) return watch(line, address);
  VENEER_ASSIGN(const ServiceStatus status, ask(address));
  const Time now = SteadyClock().now();
  line.print(json_of(status, now), table_of(status, now));
  return exit_code_of(status);
}

}  // namespace veneer::cli
