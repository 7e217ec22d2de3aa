// SPDX-License-Identifier: Apache-2.0
#include "cli/report/recorded_run.h"

#include <nlohmann/json.hpp>

#include <sstream>

#include "base/files.h"
#include "base/toml_reader.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

Result<std::vector<RecordedFrame>> read_frames(const fs::path& folder) {
  const fs::path index = folder / "frames.jsonl";
  VENEER_ASSIGN(const std::string text, read_text(index));
  std::vector<RecordedFrame> frames;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    try {
      const json entry = json::parse(line);
      frames.push_back({entry.at("frame"),
                        Duration{entry.at("display_time_ns").get<Duration::rep>()},
                        folder / entry.at("file").get<std::string>()});
    } catch (const json::exception& error) {
      return fail(Errc::kBadFormat,
                  "reading {}, line {}: {}",
                  index.string(),
                  frames.size() + 1,
                  error.what());
    }
  }
  if (frames.empty())
    return fail(Errc::kBadFormat, "reading {}: there are no frames in it", index.string());
  return frames;
}

}  // namespace

Result<RecordedRun> RecordedRun::open(const fs::path& folder) {
  RecordedRun run;
  run.folder_ = folder;
  const fs::path summary = folder / "run.json";
  VENEER_ASSIGN(const std::string text, read_text(summary));
  std::vector<std::string> settings;
  try {
    const json parsed = json::parse(text);
    settings = parsed.at("settings").get<std::vector<std::string>>();
    run.bits_ = parsed.at("bits").get<int>();
    run.tracker_start_ = Duration{parsed.at("tracker_start_ns").get<Duration::rep>()};
  } catch (const json::exception& error) {
    return fail(Errc::kBadFormat,
                "reading {}: it is no summary of a run: {}",
                summary.string(),
                error.what());
  }

  VENEER_ASSIGN(TomlReader toml, TomlReader::open(folder / "veneer.toml", settings));
  toml.read("scene", run.scene_);
  run.scene_ = folder / run.scene_;
  TomlReader tracker = toml.table("tracker");
  std::string driver;
  tracker.read("driver", driver);
  if (driver != "simulated") {
    return fail(Errc::kInvalidOption,
                "reading the run in {}: only with the simulated tracker is it known where the eye "
                "truly was",
                folder.string());
  }
  for (TomlReader& table : tracker.tables("path")) {
    VENEER_ASSIGN(tracking::Path path, tracking::Path::read(table));
    run.paths_.emplace(path.body(), path);
  }
  TomlReader output = toml.table("output");
  fs::path frames = "frames";
  output.read("folder", frames);
  VENEER_ASSIGN(run.frames_, read_frames(folder / frames));
  return run;
}

Result<std::vector<RecordedFrame>> RecordedRun::frames_in(const std::string& name) const {
  return read_frames(folder_ / name);
}

RigidTransform RecordedRun::world_from_body(tracking::BodyId body, Duration when) const {
  const auto found = paths_.find(body);
  return found == paths_.end() ? RigidTransform{}
                               : found->second.at(to_seconds(when - tracker_start_));
}

}  // namespace veneer::cli
