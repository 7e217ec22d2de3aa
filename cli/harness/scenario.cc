// SPDX-License-Identifier: Apache-2.0
#include "cli/harness/scenario.h"

#include <algorithm>
#include <cmath>

#include "base/toml_reader.h"
#include "cli/harness/statistic.h"
#include "render/scene.h"

namespace veneer::cli {
namespace {

/// As many as veneerd remembers of a run.
constexpr int kMostFrames = 65536;

Expectation read_expectation(TomlReader& table) {
  Expectation expectation;
  table.require("quantity", expectation.quantity);
  table.read("statistic", expectation.statistic);
  table.read("from_s", expectation.from_s);
  table.read("to_s", expectation.to_s);
  table.read("why", expectation.why);
  for (auto [key, bound] :
       {std::pair{"at_most", &expectation.at_most}, std::pair{"at_least", &expectation.at_least}}) {
    if (!table.contains(key)) continue;
    double value = 0;
    table.read(key, value);
    *bound = value;
  }
  if (!expectation.at_most && !expectation.at_least) {
    table.add_error("quantity", "has no bound; give at_most, at_least or both");
  }
  if (!is_statistic(expectation.statistic)) {
    table.add_error("statistic",
                    fmt::format("\"{}\" is none of {}", expectation.statistic, statistic_names()));
  }
  if (!(expectation.from_s < expectation.to_s)) {
    table.add_error("from_s", "is not before to_s");
  }
  return expectation;
}

}  // namespace

Result<Scenario> Scenario::load(const std::filesystem::path& path,
                                const std::vector<std::string>& settings) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path, settings));
  Scenario scenario;
  scenario.path = path;
  toml.require("scene", scenario.scene);
  scenario.scene = toml.folder() / scenario.scene;
  int frames = 0;
  toml.require("frames", frames);
  if (frames < 1 || frames > kMostFrames) {
    toml.add_error("frames", fmt::format("{} is outside 1 to {}", frames, kMostFrames));
  }
  TomlReader about = toml.table("scenario");
  about.require("about", scenario.about);
  for (TomlReader& table : about.tables("observer")) {
    TrueObserver observer;
    table.read("from_s", observer.from_s);
    table.require("body", observer.body);
    scenario.observers.push_back(observer);
  }
  std::ranges::stable_sort(scenario.observers, {}, &TrueObserver::from_s);
  for (TomlReader& table : toml.tables("expect")) {
    scenario.expectations.push_back(read_expectation(table));
  }
  if (scenario.expectations.empty()) {
    toml.add_error("expect", "nothing is expected; add [[expect]] tables");
  }
  TomlReader tracker = toml.table("tracker");
  scenario.faults = tracking::read_faults(tracker);
  VENEER_ASSIGN(const std::vector<tracking::Path> paths, tracking::Path::read_all(tracker));
  for (const tracking::Fault& fault : scenario.faults) {
    const auto has_body = [&fault](const tracking::Path& each) {
      return each.body() == fault.body;
    };
    if (fault.body != 0 && std::ranges::none_of(paths, has_body)) {
      tracker.add_error("fault", fmt::format("body {} has no path", fault.body));
    }
  }
  for (const tracking::Path& each : paths) scenario.paths.emplace(each.body(), each);
  if (scenario.observers.empty()) {
    VENEER_ASSIGN(const render::Scene scene, render::Scene::load(scenario.scene));
    scenario.observers.push_back({0, scene.observer_bodies.front()});
  }
  for (const TrueObserver& observer : scenario.observers) {
    if (!scenario.paths.contains(observer.body)) {
      about.add_error("observer", fmt::format("body {} has no path", observer.body));
    }
  }
  tracker.ignore_the_rest();  // veneerd reads and checks it
  toml.ignore_the_rest();
  VENEER_TRY(toml.finish());
  return scenario;
}

tracking::BodyId Scenario::observer_at(double seconds) const {
  tracking::BodyId body = observers.front().body;
  for (const TrueObserver& observer : observers) {
    if (observer.from_s <= seconds) body = observer.body;
  }
  return body;
}

}  // namespace veneer::cli
