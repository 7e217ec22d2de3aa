// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <algorithm>
#include <system_error>

#include "base/exit_code.h"
#include "base/files.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "cli/calibrate/bench_devices.h"
#include "cli/calibrate/operators.h"
#include "cli/commands/commands.h"
#include "cli/programs.h"
#include "cli/report/report.h"
#include "render/scene.h"
#include "simulation/materials/synthesize.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

/// Of every n-th frame pictures are made and colours compared.
constexpr int kLookAtEvery = 5;
/// Where the frames of the run without compensation go.
constexpr std::string_view kUncompensated = "frames-uncompensated";

struct DemoOptions {
  fs::path etc;   ///< the project's folder etc
  fs::path show;  ///< veneer.toml and scene.toml of what is shown, and its bench.toml if it has one
  fs::path out = "out/demo";
  fs::path set;  ///< the embedded material where empty
  std::string model;
  int frames = 120;
  btf::FitOptions fit;
};

/// The sample set that the demo shows: the user's, or cloth that is path-traced at the first run.
Result<fs::path> sample_set(const DemoOptions& options, Progress& progress) {
  if (!options.set.empty()) return options.set;
  const fs::path set = options.out / "cloth.btfset";
  if (is_up_to_date(set / "samples.safetensors") && btf::SampleSet::open(set)) return set;
  VENEER_ASSIGN(const simulation::HeightFieldMaterial* cloth,
                simulation::find_height_field_material("cloth"));
  simulation::SynthesisOptions synthesis;
  synthesis.samples = 32;  // noise does not compress: with half of them the fit is visibly worse
  VENEER_TRY(simulation::synthesize(*cloth, set, synthesis, progress));
  return set;
}

/// The material fitted to `set`; one of an earlier run is kept where it was fitted alike.
Status fit_material(const DemoOptions& options,
                    const fs::path& set_path,
                    const fs::path& material_path,
                    Progress& progress) {
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(options.model));
  std::error_code error;
  const std::map<std::string, std::string> provenance{
      {"fitted_on", fs::weakly_canonical(set_path, error).string()},
      {"clusters", std::to_string(options.fit.clusters)},
      {"components", options.fit.components},
      {"angular", std::to_string(options.fit.angular)}};
  if (const Result<SafetensorsFile> old = SafetensorsFile::open(material_path)) {
    const bool newer = fs::last_write_time(material_path, error) >
                       fs::last_write_time(set_path / "samples.safetensors", error);
    const bool alike = std::ranges::all_of(provenance, [&old](const auto& entry) {
      const auto found = old->metadata().find(entry.first);
      return found != old->metadata().end() && found->second == entry.second;
    });
    if (newer && alike && is_up_to_date(material_path) && old->meta("model") == options.model &&
        btf::load_material(material_path))
      return {};
  }
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                model->fit(set, options.fit, progress));
  return btf::save_material(*material, material_path, provenance);
}

/// The profile as the wizard finds it, without questions: nothing of the bench's truth is taken
/// over.
Status calibrate(const fs::path& bench_path, const fs::path& profile_path, Progress& progress) {
  AutomaticOperator nobody(/*quiet=*/true);
  VENEER_ASSIGN(const std::unique_ptr<BenchDevices> bench, BenchDevices::open(bench_path, nobody));
  calibration::WizardOptions options;
  options.profile = profile_path;
  options.session = profile_path;
  options.session += ".session";
  bench->fill(options);
  calibration::Devices devices = bench->devices();
  // What an older program found may not be what this one would.
  std::error_code ignored;
  fs::remove_all(options.session, ignored);
  VENEER_ASSIGN(const calibration::WizardOutcome outcome,
                calibration::run_wizard(options, devices, progress));
  VENEER_CHECK(outcome.finished);
  fs::remove_all(options.session, ignored);
  return {};
}

/// Removes what an earlier run left, so that no old picture is taken for a new one. A folder that
/// is no demo's is left alone.
Status clear_results(const fs::path& out) {
  std::error_code error;
  if (fs::exists(out, error) && !fs::is_empty(out, error) &&
      !fs::exists(out / "cloth.btfset", error) && !fs::exists(out / "veneer.toml", error) &&
      !fs::exists(out / "material.safetensors", error)) {
    return fail(
        Errc::kInvalidOption,
        "writing to {}: there are files in it that are not of an earlier demo; name another folder",
        out.string());
  }
  for (const char* name : {"frames",
                           "frames-uncompensated",
                           "pictures",
                           "run.json",
                           "frames.csv",
                           "report.json",
                           "index.html"}) {
    fs::remove_all(out / name, error);
    if (error) return fail(Errc::kIo, "removing {}: {}", (out / name).string(), error.message());
  }
  return {};
}

}  // namespace

Result<int> run_demo(CommandLine& line) {
  DemoOptions options;
  options.etc = default_etc();
  // What the embedded cloth needs: with 32 clusters and 6+2 scalars dE00 is 0.2 higher on the
  // bench.
  options.fit.clusters = 64;
  CLI::App& app = line.app();
  app.add_option("--out", options.out, "Where everything is written")->capture_default_str();
  app.add_option("--set", options.set, "Show this sample set in place of the embedded cloth");
  app.add_option("--model", options.model, "Fit this model (veneer fit --help lists them)")
      ->default_val("texel-colours");
  auto* components = app.add_option("--components", options.fit.components, "Its components");
  app.add_option("--clusters", options.fit.clusters, "Its clusters")->capture_default_str();
  app.add_option("--angular", options.fit.angular, "Its direction nodes")->capture_default_str();
  app.add_option("--frames", options.frames, "Frames of the walk")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  app.add_option("--etc", options.etc, "The project's folder etc");
  app.add_option(
      "--show",
      options.show,
      "A folder with veneer.toml, scene.toml and, where it is not the demo's, bench.toml "
      "(default: etc/demo)");
  line.parse();
  const bool scalars = options.model == "texel-colours" || options.model == "dichromatic-lpca";
  if (components->count() == 0) options.fit.components = scalars ? "8+4" : "8";

  const fs::path& out = options.out;
  if (options.show.empty()) options.show = options.etc / "demo";
  std::error_code ignored;
  const fs::path bench = fs::exists(options.show / "bench.toml", ignored)
                             ? options.show / "bench.toml"
                             : options.etc / "benches" / "demo.toml";
  VENEER_TRY(clear_results(out));
  VENEER_ASSIGN(const fs::path set, sample_set(options, line.progress()));
  VENEER_TRY(fit_material(options, set, out / "material.safetensors", line.progress()));
  VENEER_TRY(calibrate(bench, out / "profile", line.progress()));
  for (const char* name : {"veneer.toml", "scene.toml"}) {
    VENEER_ASSIGN(const std::string text, read_text(options.show / name));
    VENEER_TRY(write_text(out / name, text));
  }

  const std::string config = (out / "veneer.toml").string();
  const std::string frames = fmt::format("frames={}", options.frames);
  std::vector<std::string> arguments{"--config", config, "--set", frames};
  if (line.quiet()) arguments.push_back("--quiet");
  VENEER_TRY(run_program("veneerd", arguments));
  line.note("and once more without compensation, for comparison");
  arguments.insert(arguments.end(),
                   {"--set",
                    "render.compensate=false",
                    "--set",
                    fmt::format("output.folder=\"{}\"", kUncompensated),
                    "--set",
                    fmt::format("output.every={}", kLookAtEvery),
                    "--set",
                    "summary=\"\"",
                    "--set",
                    "frame_log=\"\""});
  VENEER_TRY(run_program("veneerd", arguments));

  const VerificationOptions verification_options{
      out, std::string(kUncompensated), bench, set, kLookAtEvery, out / "pictures"};
  VENEER_ASSIGN(const RunVerification verification,
                verify_run(verification_options, line.progress()));
  VENEER_ASSIGN(const std::string run_text, read_text(out / "run.json"));
  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(out / "scene.toml"));
  const nlohmann::ordered_json report = report_json(
      nlohmann::json::parse(run_text),
      verification,
      {},
      fmt::format("{} ({} {})", set.stem().string(), options.model, options.fit.components),
      scene.mesh_name);
  VENEER_TRY(write_report(report, verification, out));

  const bool met = gates_met(report);
  line.print(report,
             fmt::format("dE00 in gamut: {:.2f} mean, {:.2f} at 95 %; {:.1f} % of the pixels in "
                         "gamut; over all {:.2f} mean\n"
                         "without compensation: {:.2f} mean\n"
                         "look at {}",
                         verification.within_gamut.mean,
                         verification.within_gamut.p95,
                         100 * verification.in_gamut_fraction,
                         verification.covered.mean,
                         verification.uncompensated.mean,
                         (out / "index.html").string()));
  // A user's own material is reported, not judged: nobody promised how well it fits.
  if (!met && options.set.empty()) {
    line.note("a quality gate was missed: see \"gates\" in " + (out / "report.json").string());
    return kExitGateMissed;
  }
  return kExitDone;
}

}  // namespace veneer::cli
