// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <system_error>

#include "base/exit_code.h"
#include "base/files.h"
#include "cli/commands/capture_session.h"
#include "cli/programs.h"

namespace veneer::cli {

namespace fs = std::filesystem;

Result<int> capture_demo(CommandLine& line) {
  fs::path out = "out/capture";
  fs::path etc = default_etc();
  int frames = 120;
  CLI::App& app = line.app();
  std::string sub_command;
  app.add_option("demo", sub_command)->required();
  app.add_option("-o,--output", out, "Where everything is written")->capture_default_str();
  app.add_option("--frames", frames, "Frames that veneerd draws of the turning plate")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  app.add_option("--etc", etc, "The project's folder etc");
  line.parse();

  const fs::path studios = etc / "studios";
  const fs::path recording = out / "corrugated";
  std::vector<std::string> quiet;
  if (line.quiet()) quiet.emplace_back("--quiet");
  const auto run = [&quiet](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), quiet.begin(), quiet.end());
    return run_program("veneer", std::move(arguments));
  };
  VENEER_TRY(run({"capture",
                  "--rig",
                  (studios / "corrugated-rig.toml").string(),
                  "--studio",
                  (studios / "corrugated.toml").string(),
                  "-o",
                  recording.string()}));
  VENEER_TRY(run({"demo",
                  "--set",
                  recording.string() + ".btfset",
                  "--model",
                  "dichromatic-lpca",
                  "--components",
                  "2+2",
                  "--show",
                  (etc / "obara").string(),
                  "--frames",
                  std::to_string(frames),
                  "--out",
                  (out / "shown").string()}));
  const fs::path captured = recording / "report";
  const fs::path shown = out / "shown";
  VENEER_ASSIGN(const std::string capture_text, read_text(captured / "report.json"));
  VENEER_ASSIGN(const std::string shown_text, read_text(shown / "report.json"));
  const nlohmann::ordered_json capture = nlohmann::ordered_json::parse(capture_text);
  const nlohmann::ordered_json drawn = nlohmann::ordered_json::parse(shown_text);
  line.print({{"capture", (captured / "index.html").string()},
              {"shown", (shown / "index.html").string()},
              {"leak", capture.at("rig").at("leak")},
              {"masked", capture.at("set").at("masked")},
              {"frames", drawn.at("frames")},
              {"de00_mean", drawn.at("de00_mean")},
              {"de00_p95", drawn.at("de00_p95")}},
             fmt::format("look at {} (what was captured) and {} (what the eye receives)",
                         (captured / "index.html").string(),
                         (shown / "index.html").string()));
  return kExitDone;
}

}  // namespace veneer::cli
