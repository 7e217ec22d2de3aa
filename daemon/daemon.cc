// SPDX-License-Identifier: Apache-2.0
#include "daemon/daemon.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "btf/material.h"
#include "calibration/profile_store.h"
#include "daemon/config.h"
#include "daemon/first_start.h"
#include "daemon/profile_watcher.h"
#include "daemon/recording_tracker.h"
#include "projector/outputs.h"
#include "tracking/drivers.h"

namespace veneer::daemon {

Result<Summary> run(const std::filesystem::path& config_path,
                    const std::vector<std::string>& settings,
                    const std::atomic<bool>& stop,
                    Progress& progress,
                    std::atomic<bool>* check_profile) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(config_path, settings));
  VENEER_ASSIGN(Config config, Config::read(toml));
  VENEER_TRY(check_files_are_there(config));
  // On a virtual clock a run is repeatable, so that nothing may come in between.
  config.render.exchangeable = config.clock == ClockKind::kMonotonic;

  // Mistakes in the configuration are found before any device is touched for long: opening is
  // quick.
  std::unique_ptr<Clock> clock;
  if (config.clock == ClockKind::kVirtual) {
    clock = std::make_unique<VirtualClock>();
  } else {
    clock = std::make_unique<SteadyClock>();
  }
  TomlReader tracker_table = toml.table("tracker");
  const Time tracker_start = clock->now();
  VENEER_ASSIGN(std::unique_ptr<tracking::Tracker> tracker,
                tracking::open_tracker(tracker_table, *clock));
  TomlReader output_table = toml.table("output");
  VENEER_ASSIGN(const std::unique_ptr<projector::Output> output,
                projector::open_output(output_table));
  VENEER_TRY(toml.finish());
  if (!config.record.empty()) {
    VENEER_ASSIGN(tracking::PoseRecorder recorder, tracking::PoseRecorder::create(config.record));
    tracker = std::make_unique<RecordingTracker>(std::move(tracker), std::move(recorder));
  }

  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(config.scene));
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material, btf::load_material(config.material));
  // Before it is read, so that one that comes while we start is noticed.
  const auto known_profile = ProfileWatcher::identify(config.profile);
  VENEER_ASSIGN(const calibration::ProfileStore::Loaded loaded,
                calibration::ProfileStore(config.profile).load_newest_good());
  if (!loaded.warning.empty()) spdlog::warn("{}", loaded.warning);
  const calibration::ProjectorProfile& profile = loaded.profile;
  VENEER_ASSIGN(const std::unique_ptr<render::Renderer> renderer,
                render::Renderer::create(scene, *material, profile, config.render));
  spdlog::info(
      "material: {}, {} x {} texels", material->model(), material->width(), material->height());
  spdlog::info("renderer: {}", renderer->description());
  spdlog::info("tracker: {}", tracker->description());
  spdlog::info("output: {}", output->description());

  std::vector<tracking::BodyId> bodies = scene.observer_bodies;
  if (scene.object_body >= 0) bodies.push_back(scene.object_body);
  std::ranges::sort(bodies);
  bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
  PoseFeed poses(*tracker, *clock, config.clock, bodies, config.prediction, config.validation);
  const render::RasterFormat raster{profile.geometry.width, profile.geometry.height, profile.bits};
  std::optional<ProfileWatcher> profiles;
  if (config.render.exchangeable)
    profiles.emplace(config.profile, known_profile, raster, config.render, check_profile);
  FrameLoop loop(
      config, scene, raster, *clock, poses, *renderer, *output, profiles ? &*profiles : nullptr);
  VENEER_ASSIGN(const RunRecord record, loop.run(stop, progress));
  if (profiles) profiles->stop();

  Summary summary = summarise(record);
  summary.rejected_poses = poses.rejected();
  summary.renderer = renderer->description();
  summary.tracker = tracker->description();
  summary.output = output->description();
  summary.tracker_lost = poses.lost();
  summary.tracker_counters = tracker->status().counters;
  summary.tracker_events = poses.events();
  summary.output_waits = output->waits();
  summary.clock = config.clock == ClockKind::kVirtual ? "virtual" : "monotonic";
  summary.settings = settings;
  summary.bits = profile.bits;
  if (profiles) summary.profiles = profiles->counts();
  summary.tracker_start = tracker_start;
  if (!config.summary.empty()) VENEER_TRY(write_summary(summary, config.summary));
  if (!config.frame_log.empty()) VENEER_TRY(write_frame_log(record, config.frame_log));
  return summary;
}

}  // namespace veneer::daemon
