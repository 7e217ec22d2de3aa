// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "projector/control/pjlink/pjlink_search.h"
#include "projector/control_watch.h"
#include "projector/controls.h"

namespace veneer::cli {
namespace {

using nlohmann::ordered_json;
using projector::ProjectorControl;
using projector::ProjectorState;

struct ProjectorOptions {
  std::filesystem::path config;
  std::string driver;
  std::string host;
  std::optional<int> port;
  std::string password_file;
  std::string serial;
  std::string led_enable;
  double watch_s = 0;
  std::string value;        // an input or a pattern
  std::vector<int> levels;  // of the LEDs
};

/// A projector wants 2 s between questions; all are asked so.
constexpr Duration kWatchPeriod = std::chrono::seconds(2);

/// As TOML's basic strings are written; those of JSON are the same.
std::string quoted(const std::string& text) {
  return ordered_json(text).dump(-1, ' ', true, ordered_json::error_handler_t::replace);
}

/// The options that stand in for the [control] table, or replace values of it.
std::vector<std::string> settings_of(const ProjectorOptions& options) {
  std::vector<std::string> settings;
  const auto add = [&](const char* key, const std::string& value) {
    if (!value.empty()) settings.push_back(fmt::format("control.{} = {}", key, quoted(value)));
  };
  add("driver", options.driver);
  add("host", options.host);
  // The key is read as relative to the configuration; the option is to where one stands.
  if (!options.password_file.empty())
    add("password_file", std::filesystem::absolute(options.password_file).string());
  add("serial", options.serial);
  add("led_enable", options.led_enable);
  if (options.port) settings.push_back(fmt::format("control.port = {}", *options.port));
  return settings;
}

Result<std::unique_ptr<ProjectorControl>> open_control(const ProjectorOptions& options,
                                                       Clock& clock) {
  const std::vector<std::string> settings = settings_of(options);
  if (options.config.empty() && settings.empty())
    return fail(
        Errc::kInvalidOption,
        "say which projector: --driver pjlink --host ADDRESS, or --driver dlpc350, or --config "
        "FILE with a [control] table; veneer projector search lists those on the network");
  std::string text;
  for (const std::string& each : settings) text += each + "\n";
  VENEER_ASSIGN(TomlReader toml,
                options.config.empty() ? TomlReader::parse(text, "the command line")
                                       : TomlReader::open(options.config, settings));
  TomlReader table = toml.table("control");
  VENEER_ASSIGN(std::unique_ptr<ProjectorControl> control, projector::open_control(table, clock));
  static_cast<void>(projector::ControlWatchOptions::read(table));  // veneerd's, in the same table
  toml.ignore_the_rest();
  VENEER_TRY(toml.finish());
  return control;
}

ordered_json json_of(const ProjectorControl& control, const ProjectorState& state) {
  ordered_json json{{"control", control.description()}, {"power", projector::name_of(state.power)}};
  const auto put = [&](const char* key, const auto& value) {
    if (value) json[key] = *value;
  };
  put("input", state.input);
  put("input_label", state.input_label);
  const auto put_size = [&](const char* key, const std::optional<projector::Resolution>& size) {
    if (size) json[key] = {size->width, size->height};
  };
  put_size("input_resolution", state.input_resolution);
  put_size("panel_resolution", state.panel_resolution);
  put("muted", state.muted);
  put("frozen", state.frozen);
  put("locked", state.locked);
  put("degamma", state.degamma);
  put("processing", state.processing);
  put("led_levels", state.led_levels);
  put("led_enable", state.led_enable);
  if (state.lamps) {
    json["lamps"] = ordered_json::array();
    for (const projector::Lamp& lamp : *state.lamps)
      json["lamps"].push_back({{"hours", lamp.hours}, {"on", lamp.on}});
  }
  for (const auto& [part, health] : state.health) json["health"][part] = projector::name_of(health);
  put("maker", state.maker);
  put("model", state.model);
  put("name", state.name);
  put("serial", state.serial);
  put("firmware", state.firmware);
  json["warnings"] = projector::warnings(state);
  return json;
}

std::vector<std::string> lines_of(const ProjectorControl& control, const ProjectorState& state) {
  std::vector<std::string> lines{control.description()};
  constexpr std::string_view kPrefix = "projector.";
  for (const auto& [key, value] : projector::to_record(state))
    lines.push_back(fmt::format("  {:<20} {}", key.substr(kPrefix.size()), value));
  for (const std::string& each : projector::warnings(state)) lines.push_back("! " + each);
  return lines;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& each : lines) text += (text.empty() ? "" : "\n") + each;
  return text;
}

Result<int> status(CommandLine& line, ProjectorControl& control, const ProjectorOptions& options) {
  SteadyClock clock;
  const Time end = clock.now() + from_seconds(options.watch_s);
  const bool live = options.watch_s > 0 && !line.json() && !line.quiet();
  const bool terminal = live && ::isatty(STDOUT_FILENO) == 1;
  VENEER_ASSIGN(ProjectorState state, control.read_state());
  std::size_t height = 0;
  const auto show = [&](const std::vector<std::string>& lines) {
    if (!live) return;
    // Up by as many lines as were written before, and each wiped before it is written anew.
    if (terminal && height > 0) fmt::print("\033[{}A\033[J", height);
    for (const std::string& each : lines) fmt::print("{}\n", each);
    std::fflush(stdout);
    height = lines.size();
  };
  const ProjectorState first = state;
  show(lines_of(control, state));
  std::vector<std::string> changes;
  while (clock.now() + kWatchPeriod <= end) {
    clock.sleep_until(clock.now() + kWatchPeriod);
    VENEER_ASSIGN(state, control.read_state());
    changes = projector::differences(first, state);
    std::vector<std::string> lines = lines_of(control, state);
    for (const std::string& each : changes) lines.push_back("since the start: " + each);
    show(lines);
  }
  ordered_json json = json_of(control, state);
  if (options.watch_s > 0) json["changes"] = changes;
  line.print(json, live ? "" : joined(lines_of(control, state)));
  return kExitDone;
}

Result<int> search(CommandLine& line, const projector::pjlink::SearchOptions& options) {
  VENEER_ASSIGN(const auto found, projector::pjlink::search(options));
  ordered_json json{{"projectors", ordered_json::array()}};
  std::string text;
  for (const auto& each : found) {
    json["projectors"].push_back({{"host", each.address}, {"mac", each.mac}});
    text += fmt::format("{}{:<15}  {}", text.empty() ? "" : "\n", each.address, each.mac);
  }
  if (found.empty())
    text =
        "No projector answered. Those of PJLink class 1 never do, nor those beyond this network; "
        "look for the address in the projector's own menu.";
  line.print(json, text);
  return kExitDone;
}

using Act = Status (*)(ProjectorControl&, const ProjectorOptions&);
struct Action {
  const char* name;
  const char* summary;
  Act act;
};

constexpr std::array kActions{
    Action{"on",
           "Switch it on",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.power(true); }},
    Action{"off",
           "Switch it off",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.power(false); }},
    Action{"blank",
           "Show nothing, whatever is drawn",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.mute(true); }},
    Action{"unblank",
           "Show the picture again",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.mute(false); }},
    Action{"freeze",
           "Keep showing the present picture",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.freeze(true); }},
    Action{"unfreeze",
           "Show what is drawn again",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.freeze(false); }},
    Action{"degamma-on",
           "Switch the light engine's own tone curve on",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.set_degamma(true); }},
    Action{"degamma-off",
           "Switch the light engine's own tone curve off",
           [](ProjectorControl& c, const ProjectorOptions&) { return c.set_degamma(false); }},
};

constexpr Action kInput{
    "input", "Select an input", [](ProjectorControl& c, const ProjectorOptions& options) {
      return c.select_input(options.value);
    }};
constexpr Action kPattern{"pattern",
                          "Show a test pattern of the light engine",
                          [](ProjectorControl& c, const ProjectorOptions& options) {
                            return c.show_test_pattern(options.value);
                          }};
constexpr Action kLeds{
    "leds",
    "Set the levels of the red, green and blue LED, 0 to 255",
    [](ProjectorControl& c, const ProjectorOptions& options) {
      return c.set_led_levels({options.levels.at(0), options.levels.at(1), options.levels.at(2)});
    }};

Result<int> command(CommandLine& line,
                    ProjectorControl& control,
                    const ProjectorOptions& options,
                    const Action& action) {
  VENEER_TRY(action.act(control, options));
  line.print({{"control", control.description()}, {"done", action.name}},
             fmt::format("{}: {} is accepted", control.description(), action.name));
  return kExitDone;
}

}  // namespace

Result<int> run_projector(CommandLine& line) {
  ProjectorOptions options;
  const Action* action = nullptr;
  CLI::App& app = line.app();
  app.require_subcommand(1);
  app.add_option(
      "--config", options.config, "A file with a [control] table: rig.toml, veneer.toml");
  app.add_option("--driver", options.driver, "pjlink or dlpc350");
  app.add_option("--host", options.host, "Name or address, of PJLink");
  app.add_option("--port", options.port, "Where 4352 is not it");
  app.add_option("--password-file", options.password_file, "Its first line is the password");
  app.add_option("--serial", options.serial, "Which one of several on USB");
  app.add_option("--led-enable",
                 options.led_enable,
                 "dlpc350: what lights the LEDs after an unblank that finds them dark: sequencer, "
                 "or by hand, as in \"red blue\"");
  CLI::App* const asked =
      app.add_subcommand("status", "Say how it is, and what would spoil colours")->fallthrough();
  asked->add_option("--watch", options.watch_s, "Again every 2 s, for so many seconds")
      ->check(CLI::Range(0.0, 1e6));
  projector::pjlink::SearchOptions wanted;
  double wait_s = to_seconds(wanted.wait);
  CLI::App* const searched =
      app.add_subcommand("search", "Look for PJLink projectors of class 2 on the network");
  searched->add_option("--address", wanted.address, "The network's broadcast address")
      ->capture_default_str();
  searched->add_option("--search-port", wanted.port, "Where 4352 is not it")->capture_default_str();
  searched->add_option("--wait", wait_s, "Seconds for answers")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 60.0));
  const auto add = [&](const Action& each) {
    CLI::App* const added = app.add_subcommand(each.name, each.summary)->fallthrough();
    added->callback([&action, &each] { action = &each; });
    return added;
  };
  for (const Action& each : kActions) add(each);
  add(kInput)->add_option("input", options.value, "As status names it: digital1")->required();
  add(kPattern)->add_option("pattern", options.value, "As solid or step-bars")->required();
  add(kLeds)->add_option("levels", options.levels, "Red, green, blue")->expected(3)->required();
  line.parse();
  if (searched->parsed()) {
    wanted.wait = from_seconds(wait_s);
    return search(line, wanted);
  }
  SteadyClock clock;
  VENEER_ASSIGN(const std::unique_ptr<ProjectorControl> control, open_control(options, clock));
  return action == nullptr ? status(line, *control, options)
                           : command(line, *control, options, *action);
}

}  // namespace veneer::cli
