// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/capture_session.h"

#include <nlohmann/json.hpp>

#include <memory>
#include <optional>

#include "base/exit_code.h"
#include "base/image_files.h"
#include "base/toml_reader.h"
#include "calibration/profile.h"
#include "capture/cameras/cameras.h"
#include "capture/development/developer.h"
#include "capture/development/report.h"
#include "capture/development/sample_set.h"
#include "capture/plan.h"
#include "capture/polarisers/polarisers.h"
#include "capture/recording.h"
#include "capture/session/session.h"
#include "cli/capture/terminal_hands.h"
#include "simulation/studio/studio.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

struct CaptureOptions {
  fs::path rig;
  fs::path studio;
  fs::path out;
  bool develop_only = false;
  std::string response;
  bool ignore_leak = false;
  std::optional<double> index;
  bool fill_masked = false;
};

void declare(CLI::App& app, CaptureOptions& options) {
  app.add_option(
         "--rig", options.rig, "What is captured with what, rig.toml; docs/howto/capture.md")
      ->required();
  app.add_option(
      "--studio", options.studio, "A virtual studio, studio.toml, in place of the rig's devices");
  app.add_option("-o,--output",
                 options.out,
                 "Where the pictures go, a folder NAME; the sample set is NAME.btfset")
      ->required();
  app.add_flag("--develop-only", options.develop_only, "Take no picture, develop what is there");
  app.add_option(
         "--response",
         options.response,
         "Find the camera's curve from the brackets, where it is not linear: \"debevec\" or "
         "\"robertson\"")
      ->check(CLI::IsMember({"debevec", "robertson"}));
  app.add_flag("--ignore-leak",
               options.ignore_leak,
               "Take the polarisers as perfect whatever the mirror says, to see what that costs");
  app.add_option(
         "--index",
         options.index,
         "Refractive index of a dielectric sample: brings specular light to what unpolarised "
         "light would give")
      ->check(CLI::Range(1.0, 4.0));
  app.add_flag("--fill-masked",
               options.fill_masked,
               "Give texels that were saturated in every exposure the light of their neighbours");
}

fs::path without_slash(const fs::path& path) {
  const fs::path normal = path.lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

/// All that a session works with, real or virtual.
struct Rig {
  TerminalHands hands;
  SteadyClock clock;
  std::unique_ptr<capture::Camera> camera;
  std::unique_ptr<capture::Polariser> polariser;
  std::unique_ptr<simulation::VirtualStudio> studio;

  [[nodiscard]] capture::CaptureDevices devices() {
    if (studio) return {&studio->camera(), studio->polariser(), &studio->hands(), &studio->clock()};
    return {camera.get(), polariser.get(), &hands, &clock};
  }
};

Status open_devices(Rig& rig,
                    TomlReader& toml,
                    const capture::CapturePlan& plan,
                    const CaptureOptions& options,
                    Progress& progress) {
  TomlReader camera = toml.table("camera");
  TomlReader polariser = toml.table("polariser");
  if (!options.studio.empty()) {
    camera.ignore_the_rest();
    polariser.ignore_the_rest();
    VENEER_TRY(toml.finish());
    VENEER_ASSIGN(const simulation::StudioTruth truth,
                  simulation::StudioTruth::load(options.studio));
    fs::path cache = options.out;
    cache += ".studio";
    VENEER_ASSIGN(rig.studio, simulation::VirtualStudio::create(truth, plan, cache, progress));
    return {};
  }
  VENEER_ASSIGN(rig.camera, capture::open_camera(camera));
  // A mosaic on the sensor has nothing that turns; what the camera is, its first picture says.
  VENEER_ASSIGN(const capture::CameraFrame first, rig.camera->grab());
  if (first.mosaic == capture::Mosaic::kNone) {
    VENEER_ASSIGN(rig.polariser, capture::open_polariser(polariser, rig.hands));
  } else {
    polariser.ignore_the_rest();
  }
  return toml.finish();
}

nlohmann::ordered_json summary_of(const CaptureOptions& options,
                                  const capture::SessionOutcome& session,
                                  const nlohmann::ordered_json& report) {
  double specular = 0;
  double diffuse = 0;
  for (const auto& direction : report.at("directions")) {
    specular = std::max(specular, direction.at("predicted_specular_error").get<double>());
    diffuse = std::max(diffuse, direction.at("predicted_diffuse_error").get<double>());
  }
  return {{"recording", options.out.string()},
          {"set", options.out.string() + ".btfset"},
          {"report", (options.out / "report" / "index.html").string()},
          {"taken", session.taken},
          {"recalled", session.recalled},
          {"marks_rms_px", report.at("rig").at("views").at(0).at("marks_rms_px")},
          {"leak", report.at("rig").at("leak")},
          {"predicted_specular_error", specular},
          {"predicted_diffuse_error", diffuse},
          {"masked", report.at("set").at("masked")},
          {"negative",
           {report.at("set").at("specular_negative"), report.at("set").at("diffuse_negative")}},
          {"warnings", report.at("warnings")}};
}

Result<nlohmann::ordered_json> develop(const CaptureOptions& options,
                                       const capture::SessionOutcome& session,
                                       Progress& progress) {
  VENEER_ASSIGN(const capture::Recording recording, capture::Recording::open(options.out));
  capture::DevelopmentOptions development;
  if (!options.response.empty())
    development.recover = options.response == "debevec" ? capture::ResponseMethod::kDebevec
                                                        : capture::ResponseMethod::kRobertson;
  development.correct_leak = !options.ignore_leak;
  development.index = options.index;
  VENEER_ASSIGN(const capture::Developer developer,
                capture::Developer::create(recording, development, progress));
  capture::CaptureReport report(developer, options.out / "report");
  fs::path set = options.out;
  set += ".btfset";
  VENEER_ASSIGN(const capture::DevelopedSet developed,
                capture::write_sample_set(
                    developer,
                    set,
                    {options.fill_masked},
                    [&report](const auto& direction) { return report.add(direction); },
                    progress));
  VENEER_ASSIGN(const nlohmann::ordered_json written, report.write(developed, session.warnings));
  return summary_of(options, session, written);
}

/// Lights from the pose in a projector's profile, where the plan asks for it.
Status place_lights(capture::CapturePlan& plan) {
  if (plan.light_source != capture::LightSource::kProjector) return {};
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(plan.profile));
  const Eigen::Vector3d lens =
      plan.world_from_sample.inverse() * profile.geometry.world_from_projector.translation;
  plan.lights = {lens.normalized()};
  return {};
}

}  // namespace

Result<int> capture_session(CommandLine& line) {
  CaptureOptions options;
  declare(line.app(), options);
  line.parse();
  options.out = without_slash(options.out);
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(options.rig));
  capture::CapturePlan plan = capture::CapturePlan::read(toml);
  Rig rig;
  capture::SessionOutcome session;
  if (!options.develop_only) {
    VENEER_TRY(place_lights(plan));
    VENEER_TRY(open_devices(rig, toml, plan, options, line.progress()));
    VENEER_TRY(plan.check());
    VENEER_ASSIGN(session, capture::run_session(plan, options.out, rig.devices(), line.progress()));
  }
  VENEER_ASSIGN(const nlohmann::ordered_json summary, develop(options, session, line.progress()));
  line.print(summary,
             fmt::format("wrote {}; look at {}",
                         summary.at("set").get<std::string>(),
                         summary.at("report").get<std::string>()));
  for (const auto& warning : summary.at("warnings")) line.note(warning.get<std::string>());
  return kExitDone;
}

Result<int> capture_board(CommandLine& line) {
  fs::path rig;
  fs::path out;
  double dots_per_inch = 600;
  CLI::App& app = line.app();
  std::string sub_command;
  app.add_option("board", sub_command)->required();
  app.add_option("--rig", rig, "Whose [board] is meant, rig.toml")->required();
  app.add_option("-o,--output", out, "The picture to print, a PNG")->required();
  app.add_option("--dpi", dots_per_inch, "Of the printer")
      ->capture_default_str()
      ->check(CLI::Range(50.0, 2400.0));
  line.parse();
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(rig));
  const capture::CapturePlan plan = capture::CapturePlan::read(toml);
  toml.ignore_the_rest();  // devices are nothing to this
  VENEER_TRY(toml.finish());
  constexpr double kMmPerInch = 25.4;
  VENEER_ASSIGN(const Image<std::uint8_t> board,
                capture::draw_board(plan.board, dots_per_inch / kMmPerInch));
  Image<Rgb8> picture(board.width(), board.height());
  for (std::size_t i = 0; i < board.pixels().size(); ++i)
    picture.pixels()[i] = {board.pixels()[i], board.pixels()[i], board.pixels()[i]};
  VENEER_TRY(write_png(out, std::as_const(picture).view()));
  const double width_mm = plan.board.columns * plan.board.square_mm;
  const double height_mm = plan.board.rows * plan.board.square_mm;
  line.print({{"picture", out.string()}, {"width_mm", width_mm}, {"height_mm", height_mm}},
             fmt::format("print {} at {:.0f} dpi, without scaling: {:.1f} x {:.1f} mm; measure it "
                         "afterwards",
                         out.string(),
                         dots_per_inch,
                         width_mm,
                         height_mm));
  return kExitDone;
}

}  // namespace veneer::cli
