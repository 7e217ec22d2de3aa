// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/testing/fuzzing.h"
#include "base/testing/memory_file.h"
#include "daemon/config.h"
#include "projector/control/pjlink/pjlink.h"
#include "projector/control_watch.h"
#include "quality/governor.h"
#include "quality/ladder.h"

namespace veneer::daemon {
namespace {

bool is_within(double value, double least, double most) { return value >= least && value <= most; }

/// What finish() lets pass is within the ranges that the struct states.
std::string laws_of(const Config& config) {
  if (!is_within(config.frame_rate_hz, 1, 1000)) return "a frame rate out of range";
  if (!is_within(config.display_latency_ms, 0, 1000)) return "a latency out of range";
  if (!(config.first_pose_timeout_s > 0)) return "no time for the first pose";
  if (!is_within(config.render.geometry_floor, 1e-6, 1)) return "a geometry floor out of range";
  if (!config.drawing.cache.check()) return "a cache that does not pass its check";
  if (!config.prediction.check()) return "a prediction that does not pass its check";
  if (!config.service.check()) return "a service that does not pass its check";
  if (!config.service.metrics_file.empty() && !config.service.metrics_file.is_absolute())
    return "a metrics file whose folder depends on where the daemon was started";
  if (!is_within(config.quality.deadline_ms, 0, 1000)) return "a deadline out of range";
  if (!is_within(config.quality.rung, 0, quality::Ladder::kMost - 1)) return "a rung out of range";
  const auto mode = quality::parse_governor_mode(quality::name_of(config.quality.mode));
  if (!mode || *mode != config.quality.mode) return "a mode without a name";
  if (config.latch != Latch::kLate && config.latch != Latch::kEarly) return "a latch that is none";
  if (config.scene.empty() || (config.material.empty() && config.quality.ladder.empty()) ||
      config.profile.empty())
    return "a required path is missing";
  return "";
}

/// The first line is a setting from the command line, the rest the file. Nothing is opened: of the
/// drivers' tables, only that of a control that connects when it is first asked is read.
Verdict read(std::string_view text) {
  static const MemoryFile kFile;
  const std::size_t end = std::min(text.find('\n'), text.size());
  kFile.write(text.substr(std::min(end + 1, text.size())));
  auto toml = TomlReader::open(kFile.path(), {std::string(text.substr(0, end))});
  if (!toml) return refused(toml.error());
  const auto config = Config::read(*toml);
  if (!config) return refused(config.error());
  TomlReader control = toml->table("control");
  const auto watch = projector::ControlWatchOptions::read(control);
  const auto pjlink = projector::PjlinkOptions::read(control);
  for (const char* const table : {"tracker", "output", "control"})
    toml->table(table).ignore_the_rest();
  const Status finished = toml->finish();
  if (!finished) return refused(finished.error());
  if (!watch.check()) return accepted("a watch that does not pass its check");
  if (pjlink && !(pjlink->time_limit > Duration{0})) return accepted("no time limit");
  return accepted(laws_of(*config));
}

}  // namespace
}  // namespace veneer::daemon

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace daemon;
  static const std::string kPaths = "scene = \"s\"\nmaterial = \"m\"\nprofile = \"p\"\n";
  static const FuzzedReader kReader{
      &read,
      {"render.dither = false\n" + kPaths +
           "clock = \"virtual\"\nframes = 600\nframe_rate_hz = 59.94\ndisplay_latency_ms = 16.7\n"
           "[render]\ncompensate = true\nevaluation = \"compute\"\ncache_spacing_px = 8\n"
           "[prediction]\nhorizon_s = 0.05\ndecay_s = 0.1\nvelocity_window_s = 0.02\n"
           "[tracker]\ndriver = \"replay\"\n[output]\ndriver = \"null\"\n[control]\nhost = \"h\"\n",
       "frames = 1\n" + kPaths +
           "[control]\ndriver = \"pjlink\"\nhost = \"127.0.0.1\"\nport = 4352\npassword = \"x\"\n"
           "time_limit_s = 5\npoll_s = 30\n[presence]\n[validation]\n[[expect]]\nat_s = 1\n",
       "quality.rung = 2\n" + kPaths +
           "[service]\nbus = \"unix:path=/run/bus\"\nmetrics_port = 9101\nmetrics_file = "
           "\"veneer.prom\"\n[quality]\nladder = \"ladder.json\"\nmode = \"fixed\"\n"
           "deadline_ms = 12.5\n[pacing]\nlatch = \"early\"\n[tracker]\n[output]\n[control]\nhost "
           "= \"h\"\n",
       // Nothing but a ladder, which stands for the material.
       "service.bus = \"system\"\nscene = \"s\"\nprofile = \"p\"\n[service]\nmetrics_port = 0\n"
       "[quality]\nladder = \"l.json\"\nmode = \"deadline\"\nrung = 0\n[pacing]\nlatch = \"late\"\n"
       "[tracker]\n[output]\n[control]\nhost = \"h\"\n"},
      {16 << 10, 96}};
  return kReader;
}
