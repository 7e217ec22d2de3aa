// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <charconv>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "service/bus/bus_client.h"

namespace veneer::cli {
namespace {

struct TellOptions {
  std::string bus = "system";
  std::string file;
  int index = 0;
  std::string direction;
  double lux = 0;
  std::string colour = "1,1,1";
};

/// The service stands elsewhere, so a path is made whole here, where the person stands.
std::string whole(const std::string& file) {
  return std::filesystem::absolute(file).lexically_normal().string();
}

/// "X,Y,Z". Errors: kInvalidOption.
Result<Eigen::Vector3d> vector_of(const char* name, const std::string& text) {
  Eigen::Vector3d vector;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int i = 0; i < 3; ++i) {
    const auto [after, error] = std::from_chars(at, end, vector[i]);
    const bool separated = i < 2 ? after != end && *after == ',' : after == end;
    if (error != std::errc() || !separated)
      return fail(Errc::kInvalidOption,
                  "{}: \"{}\" is not three numbers as 0,-1,2.5",
                  name,
                  service::readable(text));
    at = after + 1;
  }
  return vector;
}

Result<service::Command> light_of(const TellOptions& options) {
  service::SetLight light;
  light.index = options.index;
  VENEER_ASSIGN(light.light.direction_to_light, vector_of("direction", options.direction));
  light.light.illuminance_lux = options.lux;
  VENEER_ASSIGN(light.light.colour, vector_of("--colour", options.colour));
  return light;
}

}  // namespace

Result<int> run_tell(CommandLine& line) {
  TellOptions options;
  std::function<Result<service::Command>()> command;
  CLI::App& app = line.app();
  app.require_subcommand(1);
  app.add_option("--bus", options.bus, "system, session or an address such as unix:path=/run/bus")
      ->capture_default_str();
  const auto add = [&](const char* name, const char* summary, auto make) {
    CLI::App* const added = app.add_subcommand(name, summary)->fallthrough();
    // CLI11 calls it once all is read.
    added->callback([&command, make] { command = make; });
    return added;
  };
  add("blank", "Go dark until unblank", [] { return service::Blank{true}; });
  add("unblank", "Show the picture again", [] { return service::Blank{false}; });
  add("reload",
      "Take what was changed in the configuration's scene, material, profile and picture",
      [] { return service::Reload{}; });
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
      ->required();
  light->add_option("lux", options.lux, "On a plane that faces it")->required();
  light->add_option("--colour", options.colour, "Linear sRGB, multiplies: R,G,B")
      ->capture_default_str();
  line.parse();
  VENEER_ASSIGN(const service::Command what, command());
  VENEER_TRY(service::check(what));  // before it is asked whether anybody is there
  VENEER_ASSIGN(const service::BusAddress address, service::BusAddress::parse(options.bus));
  VENEER_ASSIGN(service::BusClient client, service::BusClient::connect(address));
  VENEER_ASSIGN(const std::string answer, client.tell(what));
  nlohmann::ordered_json json{{"done", service::text_of(what)}};
  if (!answer.empty()) json["path"] = answer;
  line.print(json, answer.empty() ? "veneerd: " + service::text_of(what) + ": done" : answer);
  return kExitDone;
}

}  // namespace veneer::cli
