// SPDX-License-Identifier: Apache-2.0
#include "cli/harness/harness_run.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include "base/colour.h"
#include "base/files.h"
#include "base/image_files.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "render/renderer.h"
#include "tracking/presence.h"
#include "tracking/status.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// A comma-separated file with a header; texts stay texts.
class Table {
 public:
  static Result<Table> read(const fs::path& path) {
    VENEER_ASSIGN(const std::string text, read_text(path));
    Table table;
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    table.names_ = split(line);
    while (std::getline(lines, line)) {
      table.rows_.push_back(split(line));
      if (table.rows_.back().size() != table.names_.size()) {
        return fail(Errc::kBadFormat,
                    "reading {}: line {} has {} fields, the header {}",
                    path.string(),
                    table.rows_.size() + 1,
                    table.rows_.back().size(),
                    table.names_.size());
      }
    }
    return table;
  }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] const std::string& text(std::size_t row, std::string_view column) const {
    const auto found = std::ranges::find(names_, column);
    VENEER_CHECK(found != names_.end());
    return rows_[row][static_cast<std::size_t>(found - names_.begin())];
  }
  [[nodiscard]] double number(std::size_t row, std::string_view column) const {
    return std::strtod(text(row, column).c_str(), nullptr);
  }

 private:
  static std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    if (line.ends_with(',')) fields.emplace_back();  // getline() sees no last field without text
    return fields;
  }
  std::vector<std::string> names_;
  std::vector<std::vector<std::string>> rows_;
};

Eigen::Vector3d eye_of(const Scenario& scenario, const render::Scene& scene, double seconds) {
  return scenario.paths.at(scenario.observer_at(seconds)).at(seconds) * scene.eye_in_sensor;
}

/// Where the object truly is.
RigidTransform object_of(const Scenario& scenario, const render::Scene& scene, double seconds) {
  if (scene.object_body < 0) return scene.world_from_object;
  return scenario.paths.at(scene.object_body).at(seconds) * scene.world_from_object;
}

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

void add_frames(const Table& table,
                const Scenario& scenario,
                const render::Scene& scene,
                double start_ns,
                HarnessRun& run) {
  auto& q = run.quantities;
  Eigen::Vector3d shown_before = Eigen::Vector3d::Zero();
  Eigen::Vector3d true_before = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double seconds = 1e-9 * (table.number(i, "display_time_ns") - start_ns);
    const Eigen::Vector3d shown{
        table.number(i, "eye_x"), table.number(i, "eye_y"), table.number(i, "eye_z")};
    const Eigen::Vector3d truth = eye_of(scenario, scene, seconds);
    const Eigen::Vector3d object = object_of(scenario, scene, seconds).translation;
    run.seconds.push_back(seconds);
    q["position_error_mm"].push_back(1e3 * (shown - truth).norm());
    q["view_error_deg"].push_back(angle_deg(shown - object, truth - object));
    q["step_mm"].push_back(i == 0 ? 0
                                  : 1e3 * ((shown - shown_before) - (truth - true_before)).norm());
    q["specular_weight"].push_back(table.number(i, "specular_weight"));
    q["pose_age_ms"].push_back(table.number(i, "pose_age_ms"));
    q["observer"].push_back(table.number(i, "observer"));
    for (int p = 0; p <= static_cast<int>(tracking::Presence::kLost); ++p) {
      const std::string_view name = name_of(static_cast<tracking::Presence>(p));
      q[fmt::format("presence.{}", name)].push_back(table.text(i, "presence") == name ? 1 : 0);
    }
    shown_before = shown;
    true_before = truth;
  }
}

void add_states(HarnessRun& run) {
  for (int s = 0; s <= static_cast<int>(tracking::TrackerState::kSilent); ++s) {
    const std::string_view name = name_of(static_cast<tracking::TrackerState>(s));
    std::vector<double>& values = run.quantities[fmt::format("tracker.{}", name)];
    for (const double seconds : run.seconds) {
      const auto after = std::ranges::find_if(
          run.events,
          [seconds](const HarnessRun::Event& event) { return event.seconds > seconds; });
      values.push_back(after != run.events.begin() && std::prev(after)->state == name ? 1 : 0);
    }
  }
}

/// The picture for the true eye beside each one that was kept.
Status add_pictures(const Scenario& scenario,
                    const render::Scene& scene,
                    const fs::path& frames,
                    const fs::path& material_path,
                    const fs::path& profile_path,
                    HarnessRun& run,
                    Progress& progress) {
  VENEER_ASSIGN(const auto profile, calibration::ProjectorProfile::load(profile_path));
  VENEER_ASSIGN(const auto material, btf::load_material(material_path));
  VENEER_ASSIGN(
      const auto renderer,
      render::Renderer::create(scene, std::array{render::Level{material.get()}}, profile, {}));
  const Xyz white = profile.emitted(Eigen::Vector3d::Ones());
  Image<Rgb32f> right(profile.geometry.width, profile.geometry.height);
  std::vector<double>& differences = run.quantities["picture_de00"];
  differences.assign(run.seconds.size(), kNone);
  progress.start("comparing pictures", static_cast<std::int64_t>(run.seconds.size()));
  for (std::size_t i = 0; i < run.seconds.size(); ++i) {
    progress.advance(1);
    const fs::path file = frames / fmt::format("target-{:06}.exr", i);
    if (!fs::exists(file)) continue;
    VENEER_ASSIGN(const Image<Rgb32f> shown, read_exr_rgb(file, {"X", "Y", "Z"}));
    if (shown.width() != right.width() || shown.height() != right.height()) {
      return fail(Errc::kBadFormat, "reading {}: it is not of the projector's size", file.string());
    }
    renderer->draw(
        {eye_of(scenario, scene, run.seconds[i]), object_of(scenario, scene, run.seconds[i]), 0});
    renderer->read_target(right.view());
    double sum = 0;
    double count = 0;
    for (std::size_t p = 0; p < right.pixels().size(); ++p) {
      const Rgb32f& a = shown.pixels()[p];
      const Rgb32f& b = right.pixels()[p];
      if (a[1] <= 0 && b[1] <= 0) continue;
      sum += delta_e_2000(lab_from_xyz({a[0], a[1], a[2]}, white),
                          lab_from_xyz({b[0], b[1], b[2]}, white));
      count += 1;
    }
    differences[i] = count > 0 ? sum / count : 0;
  }
  progress.finish({});
  return {};
}

}  // namespace

Result<HarnessRun> read_harness_run(const Scenario& scenario,
                                    const render::Scene& scene,
                                    const fs::path& folder,
                                    const fs::path& material,
                                    const fs::path& profile,
                                    Progress& progress) {
  if (scene.object_body >= 0 && !scenario.paths.contains(scene.object_body)) {
    return fail(Errc::kInvalidOption,
                "rehearsing {}: the scene's object is body {}, which has no [[tracker.path]]",
                scenario.path.string(),
                scene.object_body);
  }
  const fs::path summary = folder / "run.json";
  VENEER_ASSIGN(const std::string text, read_text(summary));
  HarnessRun run;
  double start_ns = 0;
  try {
    const json parsed = json::parse(text);
    start_ns = parsed.at("tracker_start_ns");
    for (const auto& [name, value] : parsed.at("tracker_counters").items())
      run.counters[name] = value;
    for (const char* name :
         {"frames", "dropped_frames", "held_frames", "lost_frames", "rejected_poses"})
      run.counters[name] = parsed.at(name);
    for (const json& event : parsed.at("tracker_events")) {
      run.events.push_back({1e-9 * (event.at("t_ns").get<double>() - start_ns),
                            event.at("state"),
                            event.at("detail")});
    }
  } catch (const json::exception& error) {
    return fail(Errc::kBadFormat,
                "reading {}: it is no summary of a run: {}",
                summary.string(),
                error.what());
  }
  VENEER_ASSIGN(const Table frames, Table::read(folder / "frames.csv"));
  add_frames(frames, scenario, scene, start_ns, run);
  add_states(run);
  VENEER_TRY(add_pictures(scenario, scene, folder / "frames", material, profile, run, progress));
  return run;
}

}  // namespace veneer::cli
