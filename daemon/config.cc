// SPDX-License-Identifier: Apache-2.0
#include "daemon/config.h"

#include <cstdlib>

#include "quality/ladder.h"

namespace veneer::daemon {
namespace {

void check_range(TomlReader& toml, std::string_view key, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    toml.add_error(key, fmt::format("{} is outside {} to {}", value, least, most));
  }
}

void read_path(TomlReader& toml, std::string_view key, std::filesystem::path& path, bool required) {
  if (required) {
    toml.require(key, path);
  } else {
    toml.read(key, path);
  }
  if (!path.empty()) path = toml.folder() / path;
}

// systemd gives several, divided by colons, where a unit asks for several; the first is ours.
std::filesystem::path directory_of_the_unit(const char* variable) {
  const char* given = std::getenv(variable);
  if (given == nullptr) return {};
  const std::string all = given;
  return all.substr(0, all.find(':'));
}

void read_service(TomlReader toml, service::FrontOptions& service) {
  toml.read("bus", service.bus);
  toml.read("metrics_port", service.metrics_port);
  read_path(toml, "metrics_file", service.metrics_file, false);
  if (!service.metrics_file.empty())
    service.metrics_file = std::filesystem::absolute(service.metrics_file);
  if (const Status status = service.check(); !status) toml.add_error("bus", status.error().what);
}

// With a ladder the deadline is what it was measured for.
void read_quality(TomlReader toml, QualityConfig& quality) {
  read_path(toml, "ladder", quality.ladder, false);
  std::string mode(quality::name_of(quality.ladder.empty() ? quality::GovernorMode::kBest
                                                           : quality::GovernorMode::kDeadline));
  toml.read("mode", mode);
  if (const auto parsed = quality::parse_governor_mode(mode)) {
    quality.mode = *parsed;
  } else {
    toml.add_error("mode", parsed.error().what);
  }
  toml.read("deadline_ms", quality.deadline_ms);
  check_range(toml, "deadline_ms", quality.deadline_ms, 0, 1000);
  toml.read("rung", quality.rung);
  check_range(toml, "rung", quality.rung, 0, static_cast<double>(quality::Ladder::kMost) - 1);
}

}  // namespace

Result<Config> Config::read(TomlReader& toml) {
  Config config;
  read_path(toml, "scene", config.scene, true);
  read_quality(toml.table("quality"), config.quality);
  read_path(toml, "material", config.material, config.quality.ladder.empty());
  read_path(toml, "profile", config.profile, true);
  read_path(toml, "summary", config.summary, false);
  read_path(toml, "frame_log", config.frame_log, false);
  read_path(toml, "record", config.record, false);
  read_path(toml, "state_directory", config.state_directory, false);
  if (config.state_directory.empty())
    config.state_directory = directory_of_the_unit("STATE_DIRECTORY");
  config.runtime_directory = directory_of_the_unit("RUNTIME_DIRECTORY");

  std::string clock = "monotonic";
  toml.read("clock", clock);
  if (clock == "virtual") {
    config.clock = ClockKind::kVirtual;
  } else if (clock != "monotonic") {
    toml.add_error("clock", "expected \"monotonic\" or \"virtual\"");
  }
  toml.read("frames", config.frames);
  toml.read("frame_rate_hz", config.frame_rate_hz);
  toml.read("display_latency_ms", config.display_latency_ms);
  toml.read("first_pose_timeout_s", config.first_pose_timeout_s);
  check_range(toml, "frame_rate_hz", config.frame_rate_hz, 1, 1000);
  check_range(toml, "display_latency_ms", config.display_latency_ms, 0, 1000);
  check_range(toml, "first_pose_timeout_s", config.first_pose_timeout_s, 1e-3, 3600);

  TomlReader render = toml.table("render");
  render.read("compensate", config.render.compensate);
  render.read("dither", config.render.dither);
  render.read("geometry_floor", config.render.geometry_floor);
  check_range(render, "geometry_floor", config.render.geometry_floor, 1e-6, 1);
  render.read("average_texels", config.drawing.average_texels);
  render.read("scale", config.drawing.scale);
  check_range(render, "scale", config.drawing.scale, render::DrawingOptions::kLeastScale, 1);
  std::string evaluation = "fragment";
  render.read("evaluation", evaluation);
  if (const auto parsed = render::parse_evaluation(evaluation)) {
    config.drawing.evaluation = *parsed;
  } else {
    render.add_error("evaluation", parsed.error().what);
  }
  render.read("cache_spacing_px", config.drawing.cache.spacing);
  render.read("cache_most_turn", config.drawing.cache.most_turn);
  if (const Status status = config.drawing.cache.check(); !status) {
    render.add_error("cache_spacing_px", status.error().what);
  }

  render.read("luminance_ceiling", config.render.luminance_ceiling);
  check_range(render, "luminance_ceiling", config.render.luminance_ceiling, 0, 1e6);

  TomlReader pacing = toml.table("pacing");
  std::string latch = "late";
  pacing.read("latch", latch);
  if (latch == "early") {
    config.latch = Latch::kEarly;
  } else if (latch != "late") {
    pacing.add_error("latch", "expected \"late\" or \"early\"");
  }
  read_service(toml.table("service"), config.service);
  TomlReader control = toml.table("control");
  config.control = projector::ControlWatchOptions::read(control);
  control.ignore_the_rest();
  toml.table("tracker").ignore_the_rest();
  toml.table("output").ignore_the_rest();

  TomlReader prediction = toml.table("prediction");
  prediction.read("horizon_s", config.prediction.horizon_s);
  prediction.read("decay_s", config.prediction.decay_s);
  prediction.read("velocity_window_s", config.prediction.velocity_window_s);
  if (const Status status = config.prediction.check(); !status) {
    toml.add_error("prediction", status.error().what);
  }
  // A rehearsal's own tables (veneer harness): the same file is the daemon's configuration.
  toml.table("scenario").ignore_the_rest();
  for (TomlReader& expectation : toml.tables("expect")) expectation.ignore_the_rest();
  TomlReader presence = toml.table("presence");
  config.presence = tracking::PresenceOptions::read(presence);
  TomlReader validation = toml.table("validation");
  config.validation = tracking::ValidationOptions::read(validation);
  return config;
}

}  // namespace veneer::daemon
