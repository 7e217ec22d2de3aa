// SPDX-License-Identifier: Apache-2.0
#include "daemon/daemon.h"

#include <spdlog/spdlog.h>

#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "daemon/dark_flag.h"
#include "daemon/faults.h"
#include "daemon/figures.h"
#include "daemon/first_start.h"
#include "daemon/frame_loop.h"
#include "daemon/housekeeper.h"
#include "daemon/memory_pressure.h"
#include "daemon/output_keeper.h"
#include "daemon/projector_care.h"
#include "daemon/recording_tracker.h"
#include "daemon/reloader.h"
#include "daemon/show_loader.h"
#include "daemon/snapshots.h"

namespace veneer::daemon {
namespace {

using service::FaultKind;

std::function<Result<double>()> pressure_of(const Devices& devices, ClockKind kind) {
  if (devices.memory_pressure) return devices.memory_pressure;
  // A run in virtual time is the same on every machine.
  if (kind == ClockKind::kVirtual) return {};
  return memory_pressure;
}

std::function<Duration()> sleep_of(const Devices& devices, ClockKind kind) {
  if (devices.time_asleep) return devices.time_asleep;
  if (kind == ClockKind::kVirtual) return {};
  return time_asleep;
}

class TheDaemon final : public Daemon {
 public:
  TheDaemon(ConfigFile file, const TomlReader& started, Config config, Devices devices)
      : file_(std::move(file)),
        started_(started),
        config_(std::move(config)),
        devices_(std::move(devices)),
        housekeeper_(clock(), config_.clock, faults_, board_, pressure_of(devices_, config_.clock)),
        dark_flag_(is_virtual() ? std::filesystem::path() : config_.runtime_directory) {
    if (!dark_flag_.is_up()) return;
    // Before the first frame: nobody is to see a single one.
    spdlog::warn(
        "dark from the start: that was asked for before a crash and never taken back; `veneer tell "
        "unblank` does");
    wishes_.dark = true;
    faults_.ask_for_dark(true);
  }

  [[nodiscard]] Result<Summary> run(const std::atomic<bool>& stop, Progress& progress) override;
  [[nodiscard]] service::ServiceStatus status() const override;
  [[nodiscard]] std::uint64_t frames() const override { return board_.frames(); }
  [[nodiscard]] std::uint64_t turns() const override { return board_.turns(); }
  [[nodiscard]] Status load_material(const std::filesystem::path& material) override;
  [[nodiscard]] Status set_scene(const std::filesystem::path& scene) override;
  [[nodiscard]] Status set_light(int index, const service::LightSetting& light) override;
  [[nodiscard]] Status blank(bool on) override;
  [[nodiscard]] Status reload() override;
  [[nodiscard]] Result<std::filesystem::path> snapshot() override;
  [[nodiscard]] const service::FrontOptions& service_options() const override {
    return config_.service;
  }

 private:
  /// What is made when a run begins.
  struct Stage {
    Stage(const TheDaemon& daemon,
          PoseFeed::OpenTracker open,
          std::unique_ptr<tracking::Tracker> tracker,
          std::unique_ptr<projector::Output> screen,
          const Script& script,
          Clock& clock,
          Faults& faults)
        : raster(script.raster()),
          poses(std::move(tracker),
                std::move(open),
                clock,
                daemon.config_.clock,
                bodies_of(script.scene),
                daemon.config_.prediction,
                daemon.config_.validation),
          output(std::move(screen), daemon.devices_.open_output, clock, faults),
          loader(daemon.devices_, daemon.config_.clock, poses, clock, faults),
          reloader(daemon.file_, daemon.started_, loader, faults, clock) {}
    const render::RasterFormat raster;  // stays: who wants another one starts anew
    PoseFeed poses;
    OutputKeeper output;
    std::optional<ProjectorCare> projector;  // before the loader, whose thread looks after it
    ShowLoader loader;
    Reloader reloader;
  };
  [[nodiscard]] Clock& clock() { return is_virtual() ? static_cast<Clock&>(virtual_) : steady_; }
  [[nodiscard]] bool is_virtual() const { return config_.clock == ClockKind::kVirtual; }
  [[nodiscard]] PoseFeed::OpenTracker open_tracker();
  [[nodiscard]] Result<Stage*> stage() const;
  [[nodiscard]] Status change(FaultKind about, std::function<Status(Script&)> edit);
  [[nodiscard]] Time now() const { return is_virtual() ? virtual_.now() : steady_.now(); }
  [[nodiscard]] Summary summary_of(const RunRecord& record, Time tracker_start) const;
  void remember_dark();

  const ConfigFile file_;
  const TomlReader started_;
  const Config config_;
  const Devices devices_;
  VirtualClock virtual_;
  SteadyClock steady_;
  Faults faults_;
  FigureBoard board_;
  Wishes wishes_;
  Housekeeper housekeeper_;
  std::atomic<bool> ended_well_{false};
  std::mutex dark_mutex_;
  DarkFlag dark_flag_;
  std::optional<tracking::PoseRecorder> recorder_;
  std::timed_mutex snapshot_turn_;
  // Left when the run is over, so that who has seen it may use it.
  std::unique_ptr<Stage> stage_;
  std::atomic<Stage*> published_{nullptr};
};

PoseFeed::OpenTracker TheDaemon::open_tracker() {
  return [this]() -> Result<std::unique_ptr<tracking::Tracker>> {
    VENEER_ASSIGN(std::unique_ptr<tracking::Tracker> tracker, devices_.open_tracker(clock()));
    if (!recorder_) return tracker;
    return std::make_unique<RecordingTracker>(
        std::move(tracker), *recorder_, [this](const Status& written) {
          if (written) {
            housekeeper_.disk_works(config_.record);
          } else {
            housekeeper_.disk_failed(config_.record, written.error());
          }
        });
  };
}

Result<Summary> TheDaemon::run(const std::atomic<bool>& stop, Progress& progress) {
  // Mistakes are found before any device is touched for long: opening is quick.
  VENEER_TRY(check_files_are_there(config_));
  const Time tracker_start = clock().now();
  if (!config_.record.empty()) {
    VENEER_ASSIGN(tracking::PoseRecorder recorder, tracking::PoseRecorder::create(config_.record));
    recorder_.emplace(std::move(recorder));
  }
  const PoseFeed::OpenTracker open = open_tracker();
  VENEER_ASSIGN(std::unique_ptr<tracking::Tracker> tracker, open());
  VENEER_ASSIGN(std::unique_ptr<projector::Output> output, devices_.open_output());
  std::string warning;
  tl::expected<Script, Refusal> script = read_script(config_, &warning);
  if (!script) return tl::unexpected<Error>(std::move(script).error().error);
  if (!warning.empty()) faults_.begin(FaultKind::kProfile, now(), warning);

  stage_ = std::make_unique<Stage>(
      *this, open, std::move(tracker), std::move(output), *script, clock(), faults_);
  Stage& stage = *stage_;
  stage.loader.set_scanout(stage.output.get()->scanout());
  stage.reloader.made_of(*script);
  // On a virtual clock nobody but the frame loop moves time.
  if (devices_.open_control && !is_virtual()) {
    stage.projector.emplace([this] { return devices_.open_control(clock()); },
                            script->profile.record,
                            config_.profile,
                            config_.control,
                            faults_,
                            clock());
  }
  stage.loader.set_chore([this, &stage] {
    housekeeper_.look();
    stage.reloader.look();
    if (stage.projector)
      stage.projector->look(stage.loader.current().config.profile, stage.loader.profile_changes());
  });
  const auto& material = *script->material;
  spdlog::info(
      "material: {}, {} x {} texels", material.model(), material.width(), material.height());
  VENEER_ASSIGN(std::unique_ptr<Show> show, stage.loader.begin(*std::move(script)));
  spdlog::info("renderer: {}", show->description);
  spdlog::info("tracker: {}", stage.poses.description());
  spdlog::info("output: {}", stage.output.description());

  FrameLoop loop({config_,
                  clock(),
                  stage.poses,
                  stage.output,
                  stage.loader,
                  faults_,
                  board_,
                  wishes_,
                  devices_.before_frame,
                  sleep_of(devices_, config_.clock)},
                 std::move(show));
  published_ = &stage;
  const Result<RunRecord> record = loop.run(stop, progress);
  faults_.stopping();
  stage.loader.stop(loop.take_show());
  housekeeper_.tell();
  // After an error, here or below, systemd starts another one, which is to be as dark as this one.
  if (!record) return tl::unexpected<Error>(record.error());
  Summary summary = summary_of(*record, tracker_start);
  if (!config_.summary.empty()) VENEER_TRY(write_summary(summary, config_.summary));
  if (!config_.frame_log.empty()) VENEER_TRY(write_frame_log(*record, config_.frame_log));
  ended_well_ = true;
  remember_dark();
  return summary;
}

Summary TheDaemon::summary_of(const RunRecord& record, Time tracker_start) const {
  const Stage& stage = *stage_;
  Summary summary = summarise(record);
  summary.rejected_poses = stage.poses.rejected();
  summary.renderer = stage.loader.renderer_description();
  summary.tracker = stage.poses.description();
  summary.output = stage.output.description();
  summary.tracker_lost = stage.poses.lost();
  summary.tracker_counters = stage.poses.status().counters;
  summary.tracker_events = stage.poses.events();
  summary.output_waits = stage.output.waits();
  summary.clock = is_virtual() ? "virtual" : "monotonic";
  summary.settings = file_.settings;
  summary.bits = stage.raster.bits;
  summary.profiles = stage.loader.profile_counts();
  summary.tracker_start = tracker_start;
  summary.recovered_faults = faults_.recovered();
  return summary;
}

service::ServiceStatus TheDaemon::status() const {
  service::ServiceStatus status;
  status.state = faults_.state();
  status.faults = faults_.list();
  status.recovered = faults_.recovered();
  const FigureBoard::Figures figures = board_.last_second(now());
  status.frames = figures.frames;
  status.dropped = figures.dropped;
  status.late = figures.late;
  status.frame_rate_hz = figures.frame_rate_hz;
  status.frame_ms_median = figures.frame_ms_median;
  status.frame_ms_p95 = figures.frame_ms_p95;
  status.gpu_ms_median = figures.gpu_ms_median;
  status.latency_ms = figures.latency_ms;
  const Stage* stage = published_;
  if (stage == nullptr) return status;
  const ShowLoader::Names names = stage->loader.names();
  status.scene = names.scene;
  status.material = names.material;
  status.profile = names.profile;
  status.luminance_ceiling = names.luminance_ceiling;
  status.quality_rung = static_cast<int>(board_.rung());
  if (board_.rung() > 0 && board_.rung() < names.rungs.size())
    status.quality = fmt::format(
        "{} (rung {} of {})", names.rungs[board_.rung()], board_.rung(), names.rungs.size() - 1);
  status.renderer = stage->loader.renderer_description();
  status.output = stage->output.description();
  if (stage->projector) status.projector = stage->projector->text();
  const tracking::TrackerStatus tracker = stage->poses.status();
  status.tracker = fmt::format("{}: {}{}{}",
                               stage->poses.description(),
                               name_of(tracker.state),
                               tracker.detail.empty() ? "" : ": ",
                               tracker.detail);
  return status;
}

Result<TheDaemon::Stage*> TheDaemon::stage() const {
  Stage* stage = published_;
  if (stage == nullptr || faults_.state() == service::State::kStopping) {
    return fail(Errc::kUnavailable,
                "telling veneerd: it is {}; try again in a moment",
                stage == nullptr ? "starting" : "stopping");
  }
  return stage;
}

// Only what the files do not say is changed: a reload goes back to them.
Status TheDaemon::change(FaultKind about, std::function<Status(Script&)> edit) {
  VENEER_ASSIGN(Stage* const stage, this->stage());
  return stage->loader.call([this, stage, about, edit = std::move(edit)]() -> Status {
    Script next = stage->loader.current_as_drawn();
    VENEER_TRY(edit(next));
    VENEER_TRY(stage->loader.exchange(std::move(next)));
    stage->reloader.overridden();
    faults_.end(about, now());
    return {};
  });
}

Status TheDaemon::load_material(const std::filesystem::path& material) {
  return change(FaultKind::kMaterial, [material](Script& script) {
    script.config.material = material;
    script.config.quality.ladder.clear();  // which was measured for others
    return read_material(script);
  });
}

Status TheDaemon::set_scene(const std::filesystem::path& scene) {
  return change(FaultKind::kScene, [scene](Script& script) {
    script.config.scene = scene;
    return read_scene(script);
  });
}

Status TheDaemon::set_light(int index, const service::LightSetting& light) {
  VENEER_TRY(light.check());
  return change(FaultKind::kScene, [index, light](Script& script) -> Status {
    std::vector<render::Light>& lights = script.scene.lights;
    if (index < 0 || static_cast<std::size_t>(index) >= lights.size()) {
      return fail(Errc::kInvalidOption,
                  "setting light {}: the scene has {}, counted from 0",
                  index,
                  lights.size());
    }
    lights[static_cast<std::size_t>(index)] = render::DirectionalLight{
        light.direction_to_light.normalized(), light.illuminance_lux * light.colour};
    return {};
  });
}

Status TheDaemon::reload() {
  VENEER_ASSIGN(Stage* const stage, this->stage());
  return stage->loader.call([stage] { return stage->reloader.reload(); },
                            ShowLoader::kPatienceWithFiles);
}

Status TheDaemon::blank(bool on) {
  if (faults_.state() == service::State::kStopping) return stage().map([](Stage*) {});
  wishes_.dark = on;
  faults_.ask_for_dark(on);
  remember_dark();
  const Stage* stage = published_;
  // The frame loop cannot wait for itself, and a start or a lost output need not be waited for.
  if (stage == nullptr || stage->loader.show_here() != nullptr) return {};
  // A frame that is under way may take long on a slow machine; light need not be waited for.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(on ? 5 : 1);
  while (wishes_.is_dark != on && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  if (on && !wishes_.is_dark)
    return fail(Errc::kTimeout,
                "blanking: the display has not said within 5 s that it is dark; that is asked for "
                "and will be done when it can be; until then see to the projector itself");
  return {};
}

// Whoever comes last writes what holds then; a stop in good order ends the wish.
void TheDaemon::remember_dark() {
  const std::scoped_lock lock(dark_mutex_);
  const bool dark = wishes_.dark && !ended_well_;
  if (const Status put = dark_flag_.put(dark); !put)
    spdlog::warn(
        "{}; after a crash the projector may be {}", put.error().what, dark ? "lit" : "dark");
}

Result<std::filesystem::path> TheDaemon::snapshot() {
  VENEER_ASSIGN(Stage* const stage, this->stage());
  const auto deadline = std::chrono::steady_clock::now() + ShowLoader::kPatience;
  const std::unique_lock turn(snapshot_turn_, deadline);
  const auto busy = [] {
    return fail(Errc::kTimeout, "taking a snapshot: no frame was made in time; try again");
  };
  if (!turn) return busy();
  Snapshot picture;
  picture.codes = Image<Rgb16>(stage->raster.width, stage->raster.height);
  if (const Show* show = stage->loader.show_here()) {
    if (show->renderer && !wishes_.is_dark) show->renderer->read_codes(picture.codes.view());
  } else {
    wishes_.snapshot = &picture;
    while (!picture.done.load(std::memory_order_acquire)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      Snapshot* expected = &picture;
      // What the frame loop has begun, it ends.
      if (std::chrono::steady_clock::now() > deadline &&
          wishes_.snapshot.compare_exchange_strong(expected, nullptr))
        return busy();
    }
  }
  const Result<std::filesystem::path> written = write_snapshot(
      config_.state_directory, std::as_const(picture.codes).view(), stage->raster.bits);
  if (!written && written.error().code == Errc::kIo)
    housekeeper_.disk_failed(config_.state_directory / "snapshot", written.error());
  return written;
}

}  // namespace

Result<std::unique_ptr<Daemon>> Daemon::create(const std::filesystem::path& config_path,
                                               const std::vector<std::string>& settings,
                                               Devices devices) {
  const ConfigFile file{config_path, settings};
  std::optional<TomlReader> reader;
  VENEER_ASSIGN(Config config, file.read(&reader));
  Devices all = completed(std::move(devices), *reader, config.state_directory);
  return std::make_unique<TheDaemon>(file, *reader, std::move(config), std::move(all));
}

}  // namespace veneer::daemon
