// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>

#include "base/exit_code.h"
#include "base/files.h"
#include "cli/commands/commands.h"
#include "cli/harness/harness_run.h"
#include "cli/harness/stand_ins.h"
#include "cli/programs.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

struct HarnessOptions {
  std::vector<fs::path> scenarios;
  fs::path out = "out/harness";
  fs::path scene;
  fs::path material;
  fs::path profile;
  std::vector<std::string> settings;
  int pictures_every = 10;
};

std::string text_of(const Verdict& verdict) {
  const Expectation& e = verdict.expectation;
  std::string bounds;
  if (e.at_least) bounds += fmt::format(" at least {:g}", *e.at_least);
  if (e.at_most) bounds += fmt::format(" at most {:g}", *e.at_most);
  const bool counter = e.quantity.starts_with("counter.");
  return fmt::format("  {} {}{} = {:.4g}, expected{}{}",
                     verdict.met ? "met   " : "MISSED",
                     counter ? "" : e.statistic + " of ",
                     e.quantity,
                     verdict.value,
                     bounds,
                     e.why.empty() ? "" : ": " + e.why);
}

Result<std::vector<Verdict>> rehearse(const fs::path& path,
                                      const HarnessOptions& options,
                                      CommandLine& line) {
  std::vector<std::string> settings = options.settings;
  if (!options.scene.empty())
    settings.push_back(fmt::format("scene='{}'", fs::absolute(options.scene).string()));
  VENEER_ASSIGN(const Scenario scenario, Scenario::load(path, settings));
  const fs::path folder = options.out / scenario.name();
  std::error_code error;
  // What an earlier rehearsal left, and nothing else.
  for (const char* name : {"run.json", "frames.csv", "frames", "verdict.json", "index.html"}) {
    fs::remove_all(folder / name, error);
  }
  fs::create_directories(folder, error);
  if (error) return fail(Errc::kIo, "making {}: {}", folder.string(), error.message());

  const auto absolute = [](const fs::path& relative) { return fs::absolute(relative).string(); };
  std::vector<std::string> arguments{"--config", absolute(path), "--quiet"};
  const auto set = [&arguments](const std::string& setting) {
    arguments.insert(arguments.end(), {"--set", setting});
  };
  for (const std::string& setting : settings) set(setting);
  set(fmt::format("material='{}'", absolute(options.material)));
  set(fmt::format("profile='{}'", absolute(options.profile)));
  set(fmt::format("summary='{}'", absolute(folder / "run.json")));
  set(fmt::format("frame_log='{}'", absolute(folder / "frames.csv")));
  set("output.driver='file'");
  set(fmt::format("output.folder='{}'", absolute(folder / "frames")));
  set(fmt::format("output.every={}", options.pictures_every));
  set("output.target=true");
  VENEER_TRY(run_program("veneerd", arguments));

  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(scenario.scene));
  VENEER_ASSIGN(const HarnessRun run,
                read_harness_run(
                    scenario, scene, folder, options.material, options.profile, line.progress()));
  VENEER_ASSIGN(std::vector<Verdict> verdicts, judge(scenario.expectations, run));
  VENEER_TRY(write_harness_report(scenario, run, verdicts, folder));
  return verdicts;
}

}  // namespace

Result<int> run_harness(CommandLine& line) {
  HarnessOptions options;
  CLI::App& app = line.app();
  app.require_subcommand(1);
  CLI::App* run = app.add_subcommand(
      "run", "Drive veneerd with a simulated tracker and planned faults, and judge its frames");
  run->add_option("scenario", options.scenarios, "Scenario files (etc/scenarios)")
      ->required()
      ->check(CLI::ExistingFile);
  run->add_option("--out", options.out, "Where a folder for each scenario is written")
      ->capture_default_str();
  run->add_option("--scene", options.scene, "Your scene, in place of the scenario's");
  run->add_option(
      "--material", options.material, "Your material; a glossy texture where it is absent");
  run->add_option(
      "--profile", options.profile, "Your projector's profile; an ideal one where it is absent");
  run->add_option("--set", options.settings, "KEY=VALUE that replaces what the scenario says");
  run->add_option("--pictures-every", options.pictures_every, "Compare every n-th picture")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  line.parse();

  std::set<fs::path> names{"profile"};  // the harness's own folder
  for (const fs::path& path : options.scenarios) {
    if (!names.insert(path.stem()).second) {
      return fail(
          Errc::kInvalidOption,
          "rehearsing {}: another folder of {} is already called \"{}\"; rename the scenario",
          path.string(),
          options.out.string(),
          path.stem().string());
    }
  }
  std::error_code error;
  fs::create_directories(options.out, error);
  if (error) return fail(Errc::kIo, "making {}: {}", options.out.string(), error.message());
  if (options.material.empty()) {
    options.material = options.out / "phong.safetensors";
    VENEER_TRY(make_stand_in_material(options.material, line.progress()));
  }
  if (options.profile.empty()) {
    options.profile = options.out / "profile";
    VENEER_TRY(make_stand_in_profile(options.profile, 160, 120));
  }

  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text;
  bool all_met = true;
  for (const fs::path& path : options.scenarios) {
    VENEER_ASSIGN(const std::vector<Verdict> verdicts, rehearse(path, options, line));
    const fs::path folder = options.out / path.stem();
    const bool met = std::ranges::all_of(verdicts, &Verdict::met);
    all_met = all_met && met;
    text += fmt::format("{}: {}, look at {}\n",
                        path.stem().string(),
                        met ? "passed" : "FAILED",
                        (folder / "index.html").string());
    for (const Verdict& verdict : verdicts) text += text_of(verdict) + "\n";
    VENEER_ASSIGN(const std::string written, read_text(folder / "verdict.json"));
    json.push_back(nlohmann::ordered_json::parse(written));
  }
  if (text.ends_with('\n')) text.pop_back();
  line.print(json, text);
  return all_met ? kExitDone : kExitGateMissed;
}

}  // namespace veneer::cli
