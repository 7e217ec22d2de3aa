// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <cstdio>
#include <optional>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "cli/track/measurements.h"
#include "cli/track/report.h"
#include "cli/track/session.h"
#include "tracking/drivers.h"
#include "tracking/eye_offset.h"
#include "tracking/latency.h"
#include "tracking/pose_history.h"
#include "tracking/recording.h"
#include "tracking/usb_devices.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::ordered_json;

struct TrackOptions {
  fs::path config;
  std::vector<std::string> settings;
  fs::path file;  // a recording
  double seconds = 0;
  fs::path reference;  // a recording, too
  int body = 0;
  std::optional<int> reference_body;  // absent: `body`
  double most_latency_ms = 250;
  double smoothing_ms = 25;
};

/// What one tells at once from what comes in a blink, and what a log can bear.
constexpr Duration kScreenPeriod = 250ms;
constexpr Duration kLogPeriod = 1s;
/// A configured tracker is waited for so long in a list.
constexpr double kListPatience_s = 1;

/// Writes the state again and again: over itself on a terminal, else below.
class LiveTable {
 public:
  explicit LiveTable(bool shown)
      : shown_(shown), terminal_(shown && ::isatty(STDOUT_FILENO) == 1) {}

  [[nodiscard]] Duration period() const { return terminal_ ? kScreenPeriod : kLogPeriod; }
  void show(TrackSession& session) {
    if (!shown_) return;
    std::vector<std::string> lines{state_line(session.tracker())};
    for (std::string& line : body_table(session.bodies(), session.take_recent()))
      lines.push_back(std::move(line));
    const std::string trouble = trouble_line(session.tracker().status().counters);
    if (!trouble.empty()) lines.push_back(trouble);
    // Up by as many lines as were written before, and each line wiped before it is written anew.
    if (terminal_ && height_ > 0) fmt::print("\033[{}A\033[J", height_);
    for (const std::string& line : lines) fmt::print("{}\n", line);
    std::fflush(stdout);
    height_ = lines.size();
  }

 private:
  bool shown_;
  bool terminal_;
  std::size_t height_ = 0;
};

ordered_json summary_of(const TrackSession& session) {
  ordered_json summary = json_of(session.tracker().status());
  summary["tracker"] = session.tracker().description();
  summary["seconds"] = session.seconds();
  summary["bodies"] = json_of(session.bodies());
  return summary;
}

Result<int> list(CommandLine& line, const TrackOptions& options) {
  ordered_json json{{"drivers", ordered_json::array()}, {"plugged_in", ordered_json::array()}};
  std::string text = "drivers";
  for (const tracking::Driver& driver : tracking::drivers()) {
    json["drivers"].push_back({{"name", driver.name}, {"summary", driver.summary}});
    text += fmt::format("\n  {:<16} {}", driver.name, driver.summary);
  }
  const std::vector<tracking::UsbDevice> devices = tracking::usb_devices();
  text += devices.empty() ? "\nno tracker that is known is plugged in" : "\nplugged in";
  for (const tracking::UsbDevice& device : devices) {
    json["plugged_in"].push_back({{"driver", device.driver},
                                  {"model", device.model},
                                  {"vendor", device.vendor},
                                  {"product", device.product},
                                  {"serial", device.serial},
                                  {"port", device.port},
                                  {"needs_firmware", device.needs_firmware}});
    text += fmt::format("\n  {:<16} {} {:04x}:{:04x}, port {}{}{}{}",
                        device.driver,
                        device.model,
                        device.vendor,
                        device.product,
                        device.port,
                        device.serial.empty() ? "" : ", serial number ",
                        device.serial,
                        device.needs_firmware ? "; it waits for its firmware" : "");
  }
  if (!options.config.empty()) {
    VENEER_ASSIGN(TrackSession session, TrackSession::open(options.config, options.settings));
    VENEER_TRY(session.run(
        kListPatience_s, [](const tracking::PoseSample&) { return Status{}; }, kLogPeriod, [] {}));
    json["configured"] = summary_of(session);
    text += "\nconfigured\n  " + state_line(session.tracker());
  }
  line.print(json, text);
  return kExitDone;
}

Result<int> watch(CommandLine& line, const TrackOptions& options) {
  VENEER_ASSIGN(TrackSession session, TrackSession::open(options.config, options.settings));
  LiveTable table(!line.json() && !line.quiet());
  VENEER_TRY(session.run(
      options.seconds,
      [](const tracking::PoseSample&) { return Status{}; },
      table.period(),
      [&] { table.show(session); }));
  if (session.bodies().empty() && !line.json()) return session.nothing_came();
  std::string text = state_line(session.tracker());
  for (const std::string& each : body_table(session.bodies(), session.bodies()))
    text += "\n" + each;
  line.print(summary_of(session), text);
  return session.bodies().empty() ? kExitFailed : kExitDone;
}

Result<int> record(CommandLine& line, const TrackOptions& options) {
  VENEER_ASSIGN(TrackSession session, TrackSession::open(options.config, options.settings));
  VENEER_ASSIGN(tracking::PoseRecorder recorder, tracking::PoseRecorder::create(options.file));
  if (options.seconds <= 0) line.note("recording; Ctrl-C ends it");
  VENEER_TRY(session.run(
      options.seconds,
      [&](const tracking::PoseSample& sample) { return recorder.write(sample); },
      kLogPeriod,
      [] {}));
  if (session.bodies().empty()) return session.nothing_came();
  ordered_json json = summary_of(session);
  json["file"] = options.file.string();
  std::string text = fmt::format("wrote {}, {:.1f} s", options.file.string(), session.seconds());
  for (const std::string& each : body_table(session.bodies(), session.bodies()))
    text += "\n" + each;
  line.print(json, text);
  return kExitDone;
}

Result<int> replay(CommandLine& line, const TrackOptions& options) {
  VENEER_ASSIGN(tracking::PoseRecordingReader reader,
                tracking::PoseRecordingReader::open(options.file));
  BodyStatistics bodies;
  while (true) {
    VENEER_ASSIGN(const std::optional<tracking::PoseSample> sample, reader.next());
    if (!sample) break;
    bodies[sample->body].add(*sample, sample->time);  // when they came was not recorded
  }
  if (reader.truncated()) line.note("its last line was cut short and is left out");
  ordered_json json{{"file", options.file.string()},
                    {"truncated", reader.truncated()},
                    {"bodies", json_of(bodies)}};
  std::string text = options.file.string();
  if (bodies.empty()) text += ": no samples";
  for (const auto& [body, statistics] : bodies) {
    text += fmt::format(
        "\nbody {}: {} samples in {:.2f} s, {:.1f} Hz, jitter {:.2f} ms, longest gap {:.1f} ms, "
        "{} lost, {} out of order",
        body,
        statistics.samples(),
        to_seconds(statistics.duration()),
        statistics.rate_hz(),
        1e3 * statistics.interval_s().deviation(),
        1e3 * statistics.interval_s().max(),
        statistics.lost(),
        statistics.out_of_order());
  }
  // A latency of zero would be said of what nobody knows.
  for (ordered_json& body : json["bodies"]) {
    body.erase("latency_ms_mean");
    body.erase("latency_ms_max");
  }
  line.print(json, text);
  return kExitDone;
}

/// Says again and again how far the measurement has come, where somebody waits for it.
class EyeProgress {
 public:
  explicit EyeProgress(CommandLine& line) : line_(line), shown_(!line.json() && !line.quiet()) {
    if (!shown_) return;
    line_.note("Close one eye, hold the other at a peephole, or where two marks cover each other,");
    line_.note("and keep it there. Turn the head about it: nod, shake and tilt, slowly and far.");
  }
  void show(const tracking::PoseHistory& history) {
    if (!shown_) return;
    const auto offset = tracking::measure_eye_offset(history);
    if (!offset) return line_.note(offset.error().what);
    const bool enough = check(*offset, tracking::EyeOffsetLimits{}).has_value();
    line_.note(line_of(*offset) + (enough ? "; good enough" : "; not enough yet"));
  }

 private:
  CommandLine& line_;
  bool shown_;
};

/// What the tracker sends of the body for the time given.
Result<tracking::PoseHistory> watched_history(CommandLine& line, const TrackOptions& options) {
  VENEER_ASSIGN(TrackSession session, TrackSession::open(options.config, options.settings));
  tracking::PoseHistory history;
  EyeProgress progress(line);
  VENEER_TRY(session.run(
      options.seconds,
      [&](const tracking::PoseSample& sample) {
        if (sample.body == options.body) history.add(sample);
        return Status{};
      },
      kLogPeriod,
      [&] { progress.show(history); }));
  if (session.bodies().empty()) return session.nothing_came();
  if (session.bodies().contains(options.body)) return history;
  std::string others;
  for (const auto& [body, statistics] : session.bodies())
    others += fmt::format("{}{}", others.empty() ? "" : ", ", body);
  return fail(Errc::kNotFound,
              "{}: no sample of body {} came, but of {}; name one of them with --body",
              session.tracker().description(),
              options.body,
              others);
}

Result<int> eye(CommandLine& line, const TrackOptions& options) {
  if (options.config.empty() == options.file.empty()) {
    return fail(Errc::kInvalidOption,
                "veneer track eye: name a veneer.toml or, with --recording, a recording");
  }
  VENEER_ASSIGN(const tracking::PoseHistory history,
                options.file.empty() ? watched_history(line, options)
                                     : tracking::read_history(options.file, options.body));
  VENEER_ASSIGN(const tracking::EyeOffset offset, tracking::measure_eye_offset(history));
  const Status good = check(offset, tracking::EyeOffsetLimits{});
  ordered_json json = json_of(offset, good);
  json["body"] = options.body;
  line.print(json, text_of(offset, good));
  return good ? kExitDone : kExitGateMissed;
}

Result<int> latency(CommandLine& line, const TrackOptions& options) {
  VENEER_ASSIGN(const tracking::PoseHistory tracker,
                tracking::read_history(options.file, options.body));
  VENEER_ASSIGN(
      const tracking::PoseHistory reference,
      tracking::read_history(options.reference, options.reference_body.value_or(options.body)));
  VENEER_ASSIGN(const tracking::Latency latency,
                tracking::measure_latency(tracker,
                                          reference,
                                          {.most_s = 1e-3 * options.most_latency_ms,
                                           .smoothing_s = 1e-3 * options.smoothing_ms}));
  const Status good = check(latency, tracking::LatencyLimits{});
  line.print(json_of(latency, good), text_of(latency, good));
  return good ? kExitDone : kExitGateMissed;
}

}  // namespace

Result<int> run_track(CommandLine& line) {
  TrackOptions options;
  Result<int> (*action)(CommandLine&, const TrackOptions&) = nullptr;
  CLI::App& app = line.app();
  app.require_subcommand(1);
  const auto add = [&](const char* name, const char* summary, auto run) {
    CLI::App* command = app.add_subcommand(name, summary)->fallthrough();
    command->callback([&action, run] { action = run; });
    return command;
  };
  const auto add_config = [&](CLI::App* command) {
    command->add_option("--set", options.settings, "Replace a value: --set tracker.rate_hz=30");
    return command->add_option(
        "config", options.config, "veneer.toml, of which the [tracker] table is read");
  };
  const auto add_seconds = [&](CLI::App* command) {
    command->add_option("--seconds", options.seconds, "End after so long; 0 is until Ctrl-C")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1e6));
  };
  const auto add_body = [&](CLI::App* command) {
    command->add_option("--body", options.body, "The tracked body's number")->required();
  };
  double eye_seconds = 30;
  add_config(add("list", "Drivers, what is plugged in, and how a configured tracker does", &list));
  CLI::App* watching = add("watch", "Rate, latency, jitter and position of every body", &watch);
  add_config(watching)->required();
  add_seconds(watching);
  CLI::App* recording = add("record", "Write what a tracker sends, for replay", &record);
  add_config(recording)->required();
  add_seconds(recording);
  recording->add_option("-o,--output", options.file, "The recording to write, NAME.jsonl")
      ->required();
  CLI::App* replaying = add("replay", "Rate, gaps and length of a recording", &replay);
  replaying->add_option("file", options.file, "A recording, NAME.jsonl")->required();
  CLI::App* eyeing =
      add("eye", "Measure where the eye is in the sensor's frame, for scene.toml", &eye);
  add_config(eyeing);
  add_body(eyeing);
  eyeing->add_option("--seconds", eye_seconds, "Measure for so long; 0 is until Ctrl-C")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e6));
  eyeing->add_option("--recording", options.file, "Measure from a recording instead, NAME.jsonl");
  CLI::App* timing =
      add("latency", "How much later a tracker tells of a motion than a reference", &latency);
  timing->add_option("recording", options.file, "What the tracker told, NAME.jsonl")->required();
  timing
      ->add_option("reference",
                   options.reference,
                   "What a tracker whose latency is known told of the same motion, recorded at the "
                   "same time on the same machine")
      ->required();
  add_body(timing);
  timing->add_option("--reference-body", options.reference_body, "Where the reference counts anew");
  timing->add_option("--max-ms", options.most_latency_ms, "Look for latencies up to this")
      ->capture_default_str();
  timing
      ->add_option(
          "--smoothing-ms",
          options.smoothing_ms,
          "Smooth over so long to either side; four samples of the slower tracker must fit")
      ->capture_default_str();
  line.parse();
  if (eyeing->parsed()) options.seconds = eye_seconds;
  return action(line, options);
}

}  // namespace veneer::cli
