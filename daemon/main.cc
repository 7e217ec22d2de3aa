// SPDX-License-Identifier: Apache-2.0
// veneerd: drives the projector until it is told to stop.
#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include <atomic>
#include <csignal>

#include "base/exit_code.h"
#include "daemon/daemon.h"
#include "daemon/manual_page.h"
#include "service/front.h"
#include "service/journal/journal.h"

namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

void request_stop(int) { stop_requested = true; }

std::atomic<bool> reload_requested{false};

void request_reload(int) { reload_requested = true; }

}  // namespace

int main(int argc, char** argv) {
  using namespace veneer;
  CLI::App app("Drives a projector so that an object looks as if it were made of another material.",
               "veneerd");
  std::filesystem::path config = "/etc/veneer/veneer.toml";
  std::vector<std::string> settings;
  bool quiet = false;
  app.add_option("--config", config, "The configuration")->capture_default_str();
  app.add_option("--set",
                 settings,
                 "Replace a value of the configuration: --set frames=120 --set output.every=10");
  app.add_flag("--quiet", quiet, "Say only what goes wrong");
  bool manual = false;
  app.add_flag("--manual", manual, "Print the manual page")->group("");  // for the installation
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitUsage;
  }

  if (manual) {
    fmt::print("{}", daemon::manual_page(app));
    return kExitDone;
  }

  service::log_as("veneerd");
  if (quiet) spdlog::set_level(spdlog::level::warn);
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  action.sa_handler = request_reload;
  sigaction(SIGHUP, &action, nullptr);

  SilentProgress silent;
  const std::unique_ptr<Progress> progress = quiet ? nullptr : make_progress();
  Result<std::unique_ptr<daemon::Daemon>> daemon = daemon::Daemon::create(config, settings);
  if (!daemon) {
    spdlog::error("{}", daemon.error().what);
    return exit_code_of(daemon.error());
  }
  service::FrontOptions to_the_world = (*daemon)->service_options();
  to_the_world.reload_requested = &reload_requested;
  const auto front = service::Front::start(**daemon, to_the_world);
  const Result<daemon::Summary> summary =
      (*daemon)->run(stop_requested, quiet ? static_cast<Progress&>(silent) : *progress);
  if (!summary) {
    spdlog::error("{}", summary.error().what);
    return exit_code_of(summary.error());
  }
  if (stop_requested) spdlog::info("stopped by a signal");
  spdlog::info("{}", daemon::text_of(*summary));
  return kExitDone;
}
