// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_latency.h"

#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <thread>

#include "base/exit_code.h"
#include "base/files.h"
#include "cli/harness/stand_ins.h"
#include "cli/picture_size.h"
#include "cli/programs.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr double kGate_ms = 0.5;

/// A share of the way from a pose to its light, in the order of the way.
struct Part {
  const char* name;  ///< in the summary
  const char* what;
  bool ours;  ///< counts for the gate
};
constexpr std::array<Part, 8> kParts{{
    {"tracker", "from the measurement to its arrival", true},
    {"hand_off", "until the frame loop can read it", true},
    {"wait", "until a frame takes it up", false},
    {"draw", "what the frame loop's thread computes", true},
    {"gpu_draw", "the GPU's draw pass, and what is waited for it", false},
    {"compensate", "the GPU's compensate pass", false},
    {"present", "handing the frame over", true},
    {"display", "until the light, as configured", false},
}};

Status write_files(const BenchLatencyOptions& options, const fs::path& folder) {
  VENEER_TRY(write_text(folder / "scene.toml", R"(mesh = "sphere"
texture_repeats = [6.0, 3.0]
[observer]
tracker_body = 0
[[light]]
kind = "directional"
direction = [0.1, 0.6, 1.0]
illuminance_lux = 1300
)"));
  return write_text(folder / "veneer.toml",
                    fmt::format(R"(scene = "scene.toml"
material = "material.safetensors"
profile = "profile"
frame_rate_hz = {}
frames = {}
summary = "run.json"
[tracker]
driver = "simulated"
rate_hz = {}
[[tracker.path]]
body = 0
kind = "walk"
centre = [0.0, 0.0, 0.0]
radius_m = 0.9
height_m = 0.2
from_deg = -25
to_deg = 45
period_s = 8
[output]
driver = "null"
)",
                                options.frame_hz,
                                std::llround(options.seconds * options.frame_hz),
                                options.tracker_hz));
}

/// Of all processes that were waited for, seconds.
double cpu_of_children() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

Result<int> bench_latency(const BenchLatencyOptions& options, CommandLine& line) {
  VENEER_ASSIGN(const PictureSize size, parse_size(options.size));
  std::error_code error;
  const fs::path temporary = fs::temp_directory_path(error);
  if (error) return fail(Errc::kIo, "finding a folder for what is temporary: {}", error.message());
  VENEER_ASSIGN(const StagedFolder scratch, StagedFolder::create(temporary / "veneer-latency"));
  const fs::path& folder = scratch.path();
  VENEER_TRY(make_stand_in_material(folder / "material.safetensors", line.progress()));
  VENEER_TRY(make_stand_in_profile(folder / "profile", size.width, size.height));
  VENEER_TRY(write_files(options, folder));
  const double cpu_before = cpu_of_children();
  VENEER_TRY(run_program("veneerd", {"--config", (folder / "veneer.toml").string(), "--quiet"}));
  const double cpu_s = cpu_of_children() - cpu_before;

  VENEER_ASSIGN(const std::string text, read_text(folder / "run.json"));
  ordered_json object{
      {"size", options.size}, {"tracker_hz", options.tracker_hz}, {"frame_hz", options.frame_hz}};
  std::string table;
  double ours = 0;
  double gpu = 0;
  try {
    const ordered_json summary = ordered_json::parse(text);
    const ordered_json& budget = summary.at("latency_ms");
    const double frames = summary.at("frames");
    table = fmt::format("{}, {}, {} poses and {} frames a second\n",
                        summary.at("renderer").get<std::string>(),
                        options.size,
                        options.tracker_hz,
                        options.frame_hz);
    for (const Part& part : kParts) {
      const double ms = budget.at(part.name);
      if (part.ours) ours += ms;
      table += fmt::format(
          "  {:<11} {:8.3f} ms {} {}\n", part.name, ms, part.ours ? "*" : " ", part.what);
    }
    gpu = budget.at("gpu_draw").get<double>() + budget.at("compensate").get<double>();
    table += fmt::format("  {:<11} {:8.3f} ms\n", "total", budget.at("total").get<double>());
    object["renderer"] = summary.at("renderer");
    object["frames"] = frames;
    object["latency_ms"] = budget;
    object["cpu_ms_per_frame"] = 1e3 * cpu_s / frames;
    object["cores"] = std::thread::hardware_concurrency();
    table += fmt::format(
        "CPU time of veneerd, its start included: {:.2f} ms a frame on {} cores; the GPU's passes "
        "take {:.3f} ms\n",
        1e3 * cpu_s / frames,
        std::thread::hardware_concurrency(),
        gpu);
  } catch (const nlohmann::json::exception& wrong) {
    return fail(Errc::kBadFormat,
                "reading the summary that veneerd wrote: {}; are veneer and veneerd of the same "
                "version?",
                wrong.what());
  }
  const bool met = ours < kGate_ms;
  object["ours_ms"] = ours;
  object["gate_ms"] = kGate_ms;
  object["met"] = met;
  table += fmt::format("{}: what is ours (*) takes {:.3f} ms, the gate is {} ms",
                       met ? "met" : "MISSED",
                       ours,
                       kGate_ms);
  line.print(object, table);
  return met ? kExitDone : kExitGateMissed;
}

}  // namespace veneer::cli
