// SPDX-License-Identifier: Apache-2.0
#include "cli/report/report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <sstream>

#include "base/files.h"
#include "base/image_files.h"
#include "base/report_page.h"
#include "cli/report/pictures.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr char kPage[] =
#include "cli/report/report.html.inc"
    ;

/// The column frame_ms of frames.csv.
Result<std::vector<double>> read_frame_times(const fs::path& csv) {
  VENEER_ASSIGN(const std::string text, read_text(csv));
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);  // the header
  std::vector<double> times;
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string field;
    for (int column = 0; column < 3; ++column) std::getline(fields, field, ',');
    times.push_back(std::strtod(field.c_str(), nullptr));
  }
  return times;
}

ordered_json samples_json(const RunVerification& verification) {
  ordered_json samples = ordered_json::array();
  for (const VerifiedFrame& frame : verification.frames) {
    ordered_json pictures;
    std::vector<std::string> kinds{"projector", "received", "target", "difference"};
    if (frame.uncompensated_mean)
      kinds.insert(kinds.end(), {"uncompensated", "uncompensated_difference"});
    for (const std::string& kind : kinds)
      pictures[kind] = fmt::format("pictures/{}-{:06}.png", kind, frame.number);
    const Eigen::Vector3d& eye = frame.eye_in_world;
    ordered_json sample{{"frame", frame.number},
                        {"eye", {eye.x(), eye.y(), eye.z()}},
                        {"de00_mean", frame.within_gamut.mean},
                        {"de00_p95", frame.within_gamut.p95},
                        {"in_gamut", frame.in_gamut_fraction},
                        {"pictures", pictures}};
    if (frame.uncompensated_mean) sample["de00_uncompensated_mean"] = *frame.uncompensated_mean;
    samples.push_back(std::move(sample));
  }
  return samples;
}

}  // namespace

ordered_json report_json(const json& run,
                         const RunVerification& verification,
                         const QualityGates& gates,
                         const std::string& material,
                         const std::string& mesh) {
  const auto& v = verification;
  const bool compared = v.uncompensated.count > 0;
  ordered_json report{{"material", material}, {"mesh", mesh}};
  for (const char* key : {"renderer",
                          "frames",
                          "fps",
                          "frame_ms_p50",
                          "frame_ms_p99",
                          "pose_age_ms_p50",
                          "pose_age_ms_p99",
                          "dropped_frames",
                          "late_frames",
                          "clock",
                          "out_of_gamut",
                          "out_of_reach"}) {
    report[key] = run.at(key);
  }
  report["de00_mean"] = v.within_gamut.mean;
  report["de00_p95"] = v.within_gamut.p95;
  report["de00_max"] = v.within_gamut.max;
  report["in_gamut"] = v.in_gamut_fraction;
  report["de00_covered_mean"] = v.covered.mean;
  report["de00_covered_p95"] = v.covered.p95;
  report["de00_uncompensated_mean"] =
      compared ? ordered_json(v.uncompensated.mean) : ordered_json(nullptr);
  report["pixels_compared"] = v.within_gamut.count;
  report["pixels_on_an_edge"] = v.partial;
  report["pixels_unlit"] = v.unlit;
  report["pixels_over_white"] = v.target_over_white;
  report["gates"] = {
      {"de00_mean", v.within_gamut.count > 0 && v.within_gamut.mean <= gates.de00_mean},
      {"de00_p95", v.within_gamut.count > 0 && v.within_gamut.p95 <= gates.de00_p95},
      {"in_gamut", v.in_gamut_fraction >= gates.in_gamut},
      {"uncompensated_ratio",
       compared && v.uncompensated.mean >= gates.uncompensated_ratio * v.within_gamut.mean},
  };
  return report;
}

bool gates_met(const ordered_json& report) {
  return std::ranges::all_of(report.at("gates"),
                             [](const ordered_json& met) { return met.get<bool>(); });
}

Status write_report(const ordered_json& report,
                    const RunVerification& verification,
                    const fs::path& run_folder) {
  VENEER_ASSIGN(const std::vector<double> frame_ms, read_frame_times(run_folder / "frames.csv"));
  const Image<Rgb8> legend = difference_legend(200, 12);
  VENEER_TRY(write_png(run_folder / "pictures" / "legend.png", legend.view()));
  const ordered_json data{{"report", report},
                          {"samples", samples_json(verification)},
                          {"frame_ms", frame_ms},
                          {"difference_scale", kDifferenceScale}};
  VENEER_TRY(write_text(run_folder / "index.html", page_with_data(kPage, data)));
  return write_text(run_folder / "report.json", report.dump(2) + "\n");
}

}  // namespace veneer::cli
