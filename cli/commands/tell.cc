// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "service/bus/bus_client.h"

namespace veneer::cli {
namespace {

struct TellOptions {
  std::string bus = "system";
  std::string file;
  int index = 0;
  std::vector<double> direction;
  double lux = 0;
  std::vector<double> colour{1, 1, 1};
};

/// The service stands elsewhere, so a path is made whole here, where the person stands.
std::string whole(const std::string& file) {
  return std::filesystem::absolute(file).lexically_normal().string();
}

service::SetLight light_of(const TellOptions& options) {
  const std::vector<double>& d = options.direction;
  const std::vector<double>& c = options.colour;
  return {options.index, {{d.at(0), d.at(1), d.at(2)}, options.lux, {c.at(0), c.at(1), c.at(2)}}};
}

}  // namespace

Result<int> run_tell(CommandLine& line) {
  TellOptions options;
  std::optional<service::Command> command;
  CLI::App& app = line.app();
  app.require_subcommand(1);
  app.add_option("--bus", options.bus, "system, session or an address such as unix:path=/run/bus")
      ->capture_default_str();
  const auto add = [&](const char* name, const char* summary, auto make) {
    CLI::App* const added = app.add_subcommand(name, summary)->fallthrough();
    // CLI11 calls it once all is read.
    added->callback([&command, make] { command = make(); });
    return added;
  };
  add("blank", "Go dark until unblank", [] { return service::Blank{true}; });
  add("unblank", "Show the picture again", [] { return service::Blank{false}; });
  add("reload", "Read the configuration anew", [] { return service::Reload{}; });
  add("snapshot", "Keep the next frame as a picture", [] { return service::Snapshot{}; });
  add("material",
      "Look as if made of this",
      [&] { return service::LoadMaterial{whole(options.file)}; })
      ->add_option("file", options.file, "NAME.safetensors")
      ->required();
  add("scene", "Show this scene", [&] { return service::SetScene{whole(options.file)}; })
      ->add_option("file", options.file, "scene.toml")
      ->required();
  CLI::App* const light =
      add("light", "Replace a light of the scene", [&] { return light_of(options); });
  light->add_option("index", options.index, "Which one, from 0")->required();
  light->add_option("direction", options.direction, "Towards the light, in the world: X,Y,Z")
      ->delimiter(',')
      ->expected(3)
      ->required();
  light->add_option("lux", options.lux, "On a plane that faces it")->required();
  light->add_option("--colour", options.colour, "Linear sRGB, multiplies: R,G,B")
      ->delimiter(',')
      ->expected(3);
  line.parse();
  VENEER_ASSIGN(const service::BusAddress address, service::BusAddress::parse(options.bus));
  VENEER_ASSIGN(service::BusClient client, service::BusClient::connect(address));
  VENEER_ASSIGN(const std::string answer, client.tell(*command));
  nlohmann::ordered_json json{{"done", service::text_of(*command)}};
  if (!answer.empty()) json["path"] = answer;
  line.print(json, answer.empty() ? "veneerd: " + service::text_of(*command) + ": done" : answer);
  return kExitDone;
}

}  // namespace veneer::cli
