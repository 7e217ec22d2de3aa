// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_governor.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <thread>
#include <utility>

#include "base/clock.h"
#include "base/exit_code.h"
#include "base/files.h"
#include "base/statistics.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "calibration/profile.h"
#include "cli/governor/drive.h"
#include "cli/governor/load.h"
#include "cli/harness/stand_ins.h"
#include "cli/picture_size.h"
#include "quality/governor.h"
#include "render/renderer.h"
#include "simulation/materials/phong_texture.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kOverCheapest = 1.3;  // the deadline
constexpr double kSettle_s = 2;
constexpr double kLeastSeconds = 3 * (kSettle_s + 1);
constexpr double kLeastInside = 0.99;
constexpr double kLeastBetweenSteps_s = 1;
constexpr int kTimedFrames = 40;        // of each rung, without load
constexpr double kCheapest_s = 5;       // of the last rung, under load, of which
constexpr double kUntilLoaded_s = 1;    // are not counted
constexpr std::size_t kProbeEvery = 4;  // frames
constexpr double kWorthAStep = 0.95;    // of the rung before

struct Rung {
  std::string name;
  render::Level level;
  double ms = 0;  ///< without load
};

/// What can be taken off the material, from the best picture down.
std::vector<Rung> rungs_of(const btf::Material& material) {
  const render::AngularCacheOptions cache{.spacing = 16};
  std::vector<Rung> rungs;
  rungs.push_back({"averaged", {&material, {.average_texels = true}}});
  rungs.push_back({"plain", {&material, {}}});
  rungs.push_back({"cache", {&material, {.cache = cache}}});
  for (const double scale : {0.75, 0.5, 0.25}) {
    const render::DrawingOptions drawing{.scale = scale};
    rungs.push_back({fmt::format("scale {}", scale), {&material, drawing}});
  }
  return rungs;
}

Result<std::unique_ptr<btf::Material>> fit_material(const fs::path& folder, Progress& progress) {
  simulation::SynthesisOptions synthesis;
  synthesis.size = 16;
  VENEER_TRY(simulation::synthesize_phong(folder / "phong.btfset", synthesis, progress));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(folder / "phong.btfset"));
  VENEER_ASSIGN(const btf::Model* model, btf::find_model("lpca"));
  btf::FitOptions options;
  options.components = "8";
  options.clusters = 8;
  options.iterations = 5;  // only times count
  return model->fit(set, options, progress);
}

Result<render::Scene> make_scene() {
  render::Scene scene;
  scene.mesh_name = "sphere";
  VENEER_ASSIGN(scene.mesh, load_mesh(scene.mesh_name));
  scene.texture_repeats = {6, 3};
  scene.lights.emplace_back(
      render::DirectionalLight{Eigen::Vector3d(0.1, 0.6, 1.0).normalized(), {1300, 1300, 1300}});
  return scene;
}

/// Somebody walks to and fro before the object.
render::FrameInput input_at(double second, std::uint32_t frame) {
  render::FrameInput input;
  const double azimuth = 0.2 + 0.6 * std::sin(0.8 * second);
  input.eye_in_world = {0.9 * std::sin(azimuth), 0.2, 0.9 * std::cos(azimuth)};
  input.dither_seed = frame;
  return input;
}

/// Draws frames at a steady pace, as the daemon's loop does: a turn that was missed is not made up
/// for.
class Pace {
 public:
  explicit Pace(double hz) : period_(from_seconds(1.0 / hz)), begin_(clock_.now()) {}
  [[nodiscard]] double second() const { return to_seconds(clock_.now() - begin_); }
  [[nodiscard]] Time now() const { return clock_.now(); }
  void wait() {
    const Duration since = clock_.now() - begin_;
    clock_.sleep_until(begin_ + (since / period_ + 1) * period_);
  }

 private:
  SteadyClock clock_;
  Duration period_;
  Time begin_;
};

double draw(render::Renderer& renderer, const render::FrameInput& input) {
  const SteadyClock clock;
  const Time begin = clock.now();
  renderer.draw(input);
  renderer.finish();
  return 1e3 * to_seconds(clock.now() - begin);
}

void time_rungs(std::vector<Rung>& rungs, render::Renderer& renderer, Progress& progress) {
  std::vector<std::vector<double>> ms(rungs.size());
  progress.start("timing rungs", kTimedFrames);
  for (int frame = -2; frame < kTimedFrames; ++frame) {
    for (std::size_t i = 0; i < rungs.size(); ++i) {  // taking turns: others' load hits all alike
      render::FrameInput input = input_at(0.1 * frame, 0);
      input.level = input.next_level = i;
      const double took = draw(renderer, input);
      if (frame >= 0) ms[i].push_back(took);
    }
    if (frame >= 0) progress.advance();
  }
  progress.finish();
  for (std::size_t i = 0; i < rungs.size(); ++i) rungs[i].ms = quantile(std::move(ms[i]), 0.5);
}

/// Only what is cheaper than all before it is worth a step.
std::vector<Rung> front_of(const std::vector<Rung>& rungs) {
  std::vector<Rung> front;
  for (const Rung& rung : rungs) {
    if (front.empty() || rung.ms < kWorthAStep * front.back().ms) front.push_back(rung);
  }
  return front;
}

struct Cheapest {
  std::vector<double> ms;
  [[nodiscard]] double deadline_ms() const { return kOverCheapest * quantile(ms, 0.5); }
  [[nodiscard]] double inside() const {
    const auto in_time =
        std::ranges::count_if(ms, [limit = deadline_ms()](double each) { return each <= limit; });
    return static_cast<double>(in_time) / static_cast<double>(ms.size());
  }
};

Cheapest time_cheapest(std::size_t rung, std::size_t threads, double hz, render::Renderer& r) {
  Cheapest cheapest;
  const BusyThreads load(threads);
  Pace pace(hz);
  while (pace.second() < kCheapest_s) {
    render::FrameInput input = input_at(pace.second(), 0);
    input.level = input.next_level = rung;
    const double ms = draw(r, input);
    if (pace.second() >= kUntilLoaded_s || cheapest.ms.empty()) cheapest.ms.push_back(ms);
    pace.wait();
  }
  return cheapest;
}

struct Phase {
  std::string_view name;
  std::size_t busy_threads;
  LoadPhase time{};
  std::optional<double> others{};           ///< of the processors, that other programs had
  std::optional<double> cheapest_inside{};  ///< of the last rung's probes, steady
};

struct Drive {
  std::vector<GovernedFrame> frames;
  /// Of the last rung, drawn now and then between frames: whether anyone could have kept the
  /// deadline at that moment. The governor is not told of them.
  std::vector<GovernedFrame> probes;
};

Drive drive(quality::Governor& governor,
            std::span<Phase> phases,
            const BenchGovernorOptions& options,
            render::Renderer& renderer,
            Progress& progress) {
  Drive run;
  Pace pace(options.frame_hz);
  const double each_s = options.seconds / static_cast<double>(phases.size());
  progress.start("driving", std::llround(options.seconds * options.frame_hz));
  std::uint32_t seed = 0;
  for (Phase& phase : phases) {
    const BusyThreads load(phase.busy_threads);
    const OtherPrograms others;
    phase.time.from_s = pace.second();
    for (double now = phase.time.from_s; now < phase.time.from_s + each_s; now = pace.second()) {
      render::FrameInput input = input_at(now, seed++);
      const quality::Governor::Choice choice = governor.next(pace.now());
      input.level = choice.level;
      input.next_level = choice.next_level;
      input.fade = choice.fade;
      const double ms = draw(renderer, input);
      governor.took(choice, ms);
      run.frames.push_back({now, governor.rung(), choice.level != choice.next_level, ms});
      progress.advance();
      pace.wait();
      if (run.frames.size() % kProbeEvery != 0) continue;
      const double probed_s = pace.second();
      input.level = input.next_level = governor.rung_count() - 1;
      run.probes.push_back({probed_s, input.level, false, draw(renderer, input)});
      pace.wait();
    }
    phase.time.to_s = pace.second();
    phase.others = others.share();
  }
  progress.finish();
  return run;
}

ordered_json or_null(const std::optional<double>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

std::string percent(const std::optional<double>& part) {
  return part ? fmt::format("{:.1f} %", 100 * *part) : "-";
}

/// What was measured and what is said of it.
struct Outcome {
  ordered_json object;
  std::string table;
  bool met = true;
  void judge(bool met_here, const std::string& what) {
    met = met && met_here;
    object["gates"].push_back({{"what", what}, {"met", met_here}});
    table += fmt::format("\n{}: {}", met_here ? "met" : "MISSED", what);
  }
};

void tell_phases(const std::vector<Rung>& rungs,
                 std::span<const Phase> phases,
                 std::span<const PhaseFigures> figures,
                 Outcome& outcome) {
  outcome.table +=
      fmt::format("\n{:<14} {:>5} {:>7} {:>7} {:>8} {:>8} {:>8} {:>6} {:>8}   time on rungs",
                  "",
                  "busy",
                  "others",
                  "frames",
                  "steady",
                  "cheapest",
                  "all",
                  "steps",
                  "returns");
  for (std::size_t i = 0; i < phases.size(); ++i) {
    const PhaseFigures& f = figures[i];
    std::string shares;
    ordered_json share_of_rung;
    for (std::size_t r = 0; r < rungs.size(); ++r) {
      share_of_rung[rungs[r].name] = f.share_of_rung[r];
      if (f.share_of_rung[r] > 0)
        shares += fmt::format("  {} {:.0f} %", rungs[r].name, 100 * f.share_of_rung[r]);
    }
    outcome.table += fmt::format("\n{:<14} {:>5} {:>7} {:>7} {:>8} {:>8} {:>8} {:>6} {:>8} {}",
                                 phases[i].name,
                                 phases[i].busy_threads,
                                 percent(phases[i].others),
                                 f.frames,
                                 percent(f.inside_steady),
                                 percent(phases[i].cheapest_inside),
                                 percent(f.inside),
                                 f.steps,
                                 f.returns,
                                 shares);
    outcome.object["phases"].push_back({{"name", phases[i].name},
                                        {"from_s", phases[i].time.from_s},
                                        {"to_s", phases[i].time.to_s},
                                        {"busy_threads", phases[i].busy_threads},
                                        {"other_programs", or_null(phases[i].others)},
                                        {"frames", f.frames},
                                        {"steady_frames", f.steady_frames},
                                        {"inside_steady", or_null(f.inside_steady)},
                                        {"cheapest_inside", or_null(phases[i].cheapest_inside)},
                                        {"inside", or_null(f.inside)},
                                        {"steps", f.steps},
                                        {"steps_per_minute", f.steps_per_minute},
                                        {"returns", f.returns},
                                        {"longest_returns", f.longest_returns},
                                        {"share_of_rung", share_of_rung}});
  }
}

}  // namespace

Result<int> bench_governor(const BenchGovernorOptions& options, CommandLine& line) {
  VENEER_ASSIGN(const PictureSize size, parse_size(options.size, 16, 8192));
  if (options.seconds < kLeastSeconds)
    return fail(Errc::kInvalidOption,
                "--seconds {}: with less than {} there is no time in which a load is steady",
                options.seconds,
                kLeastSeconds);
  std::error_code error;
  const fs::path temporary = fs::temp_directory_path(error);
  if (error) return fail(Errc::kIo, "finding a folder for what is temporary: {}", error.message());
  VENEER_ASSIGN(const StagedFolder scratch, StagedFolder::create(temporary / "veneer-governor"));
  VENEER_ASSIGN(const auto material, fit_material(scratch.path(), line.progress()));
  VENEER_TRY(make_stand_in_profile(scratch.path() / "profile", size.width, size.height));
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(scratch.path() / "profile"));
  VENEER_ASSIGN(const render::Scene scene, make_scene());

  const auto make_renderer = [&](const std::vector<Rung>& rungs) {
    std::vector<render::Level> levels;
    for (const Rung& rung : rungs) levels.push_back(rung.level);
    return render::Renderer::create(scene, levels, profile, {});
  };
  std::vector<Rung> rungs = rungs_of(*material);
  {
    VENEER_ASSIGN(const auto all, make_renderer(rungs));
    time_rungs(rungs, *all, line.progress());
  }
  rungs = front_of(rungs);
  if (rungs.size() < 2)
    return fail(
        Errc::kUnavailable,
        "timing rungs at {}: all ways to draw cost the same here, {:.2f} ms, and a governor "
        "has nothing to choose from; try a larger --size",
        options.size,
        rungs.front().ms);
  VENEER_ASSIGN(const auto renderer, make_renderer(rungs));

  const std::size_t threads = options.busy_threads > 0
                                  ? static_cast<std::size_t>(options.busy_threads)
                                  : std::max<std::size_t>(std::thread::hardware_concurrency(), 1);
  const Cheapest cheapest = time_cheapest(rungs.size() - 1, threads, options.frame_hz, *renderer);
  quality::GovernorOptions governed;
  governed.mode = quality::GovernorMode::kDeadline;
  governed.deadline_ms = cheapest.deadline_ms();
  std::vector<double> ratios;
  for (const Rung& rung : rungs) ratios.push_back(rung.ms);
  quality::Governor governor(governed, ratios);
  std::array<Phase, 3> phases{{{"before", 0}, {"under load", threads}, {"after", 0}}};
  const Drive run = drive(governor, phases, options, *renderer, line.progress());

  std::vector<PhaseFigures> figures;
  for (Phase& phase : phases) {
    const auto of = [&](const std::vector<GovernedFrame>& frames) {
      return figures_of(frames, phase.time, governed.deadline_ms, rungs.size(), kSettle_s);
    };
    figures.push_back(of(run.frames));
    phase.cheapest_inside = of(run.probes).inside_steady;
  }
  Outcome outcome;
  outcome.object = {{"renderer", renderer->description()},
                    {"size", options.size},
                    {"frame_hz", options.frame_hz},
                    {"cores", std::thread::hardware_concurrency()},
                    {"deadline_ms", governed.deadline_ms},
                    {"cheapest_under_load",
                     {{"ms_median", quantile(cheapest.ms, 0.5)},
                      {"ms_p95", quantile(cheapest.ms, 0.95)},
                      {"inside", cheapest.inside()}}}};
  outcome.table = fmt::format("{}, {} at {} Hz\nrungs without load, ms:",
                              renderer->description(),
                              options.size,
                              options.frame_hz);
  for (const Rung& rung : rungs) {
    outcome.object["rungs"].push_back({{"name", rung.name}, {"ms", rung.ms}});
    outcome.table += fmt::format("  {} {:.2f}", rung.name, rung.ms);
  }
  outcome.table += fmt::format(
      "\ndeadline {:.2f} ms; the cheapest rung by itself under load: median {:.2f}, p95 {:.2f} ms, "
      "{:.1f} % inside",
      governed.deadline_ms,
      quantile(cheapest.ms, 0.5),
      quantile(cheapest.ms, 0.95),
      100 * cheapest.inside());
  tell_phases(rungs, phases, figures, outcome);

  const std::optional<double> least = least_between_steps(run.frames);
  const std::optional<double> back =
      seconds_to(figures.front().last_rung, run.frames, phases.back().time);
  outcome.object["steps"] = governor.steps();
  outcome.object["least_between_steps_s"] = or_null(least);
  outcome.object["back_after_s"] = or_null(back);
  for (std::size_t i = 0; i < phases.size(); ++i)
    outcome.judge(figures[i].inside_steady.value_or(0) >= kLeastInside,
                  fmt::format("{}: {} of the steady frames inside, the gate is {:.0f} %",
                              phases[i].name,
                              percent(figures[i].inside_steady),
                              100 * kLeastInside));
  outcome.judge(!least || *least >= kLeastBetweenSteps_s,
                least ? fmt::format("{:.2f} s at least between two steps", *least)
                      : "no two steps to be too near each other");
  outcome.judge(
      std::ranges::all_of(figures, [](const PhaseFigures& f) { return f.longest_returns < 2; }),
      "not back and forth and back under one load");
  outcome.judge(
      back.has_value(),
      back ? fmt::format("on \"{}\" as before, or better, {:.1f} s after the load had gone",
                         rungs[figures.front().last_rung].name,
                         *back)
           : "not as good as before until the end");
  line.print(outcome.object, outcome.table);
  return options.gate && !outcome.met ? kExitGateMissed : kExitDone;
}

}  // namespace veneer::cli
