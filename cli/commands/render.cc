// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <array>
#include <cstdio>

#include "base/exit_code.h"
#include "base/image_files.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "cli/commands/commands.h"
#include "cli/commands/render_from_eye.h"
#include "cli/picture_size.h"
#include "render/renderer.h"

namespace veneer::cli {

Result<int> run_render(CommandLine& line) {
  std::filesystem::path scene_path;
  std::filesystem::path material_path;
  std::filesystem::path profile_path;
  std::filesystem::path out;
  std::vector<double> eye{0, 0, 1};
  render::RendererOptions options;
  render::DrawingOptions drawing;
  bool uncompensated = false;
  std::string evaluation = "fragment";
  bool from_eye = false;
  RenderFromEyeOptions seen;
  std::string size = fmt::format("{}x{}", seen.view.width, seen.view.height);
  CLI::App& app = line.app();
  app.add_option("scene", scene_path, "The scene, scene.toml")->required();
  app.add_option("--material", material_path, "The material, NAME.safetensors")->required();
  CLI::Option* const eye_flag =
      app.add_flag("--from-eye",
                   from_eye,
                   "Draw what the eye would see of the object, not what a projector sends");
  app.add_option("--profile", profile_path, "The projector profile (veneer calibrate writes one)")
      ->excludes(eye_flag);
  app.add_option("--eye", eye, "Where the eye is, x,y,z in metres")
      ->delimiter(',')
      ->expected(3)
      ->capture_default_str();
  app.add_flag(
         "--uncompensated", uncompensated, "Send the target as if projector and surface were ideal")
      ->excludes(eye_flag);
  app.add_flag("--average-texels",
               drawing.average_texels,
               "Show the mean of the texels under a pixel, not the one at its centre")
      ->excludes(eye_flag);
  app.add_option("--evaluation",
                 evaluation,
                 "Where the material is evaluated: fragment, or compute over the visible pixels")
      ->capture_default_str()
      ->excludes(eye_flag);
  app.add_option("--cache",
                 drawing.cache.spacing,
                 "Pixels between the nodes of the angular cache; 0 draws every pixel by itself")
      ->capture_default_str()
      ->excludes(eye_flag);
  app.add_option("--cache-turn",
                 drawing.cache.most_turn,
                 "The most that directions may turn between nodes, about radians")
      ->capture_default_str()
      ->excludes(eye_flag);
  app.add_option("--scale",
                 drawing.scale,
                 "Draw on a raster this much smaller than the projector's, 0.25 to 1")
      ->capture_default_str()
      ->excludes(eye_flag);
  app.add_flag("--shells",
               seen.view.shells,
               "From the eye, each layer of a layered material as a shell around the mesh, so that "
               "the contour of the texture shows")
      ->needs(eye_flag);
  app.add_option("--size", size, "Pixels of the picture from the eye, WIDTHxHEIGHT")
      ->capture_default_str()
      ->needs(eye_flag);
  app.add_option(
         "--samples", seen.view.samples, "Along each side of a pixel of the picture from the eye")
      ->capture_default_str()
      ->needs(eye_flag);
  app.add_option(
         "--white",
         seen.white_nits,
         "What a PNG from the eye shows as white, cd/m^2; 0: all but its brightest hundredth "
         "is below")
      ->capture_default_str()
      ->needs(eye_flag);
  app.add_option(
         "-o,--output",
         out,
         "frame.png: the drive codes; frame.exr: the luminance aimed at, XYZ in cd/m^2. From "
         "the eye a picture for people, or XYZ in cd/m^2 and A, how much is hidden")
      ->required();
  line.parse();
  if (!from_eye && profile_path.empty())
    return fail(Errc::kInvalidOption,
                "drawing a scene: say for which projector with --profile, or ask for what the eye "
                "sees with --from-eye");
  VENEER_ASSIGN(const PictureSize seen_size, parse_size(size));
  seen.view.width = seen_size.width;
  seen.view.height = seen_size.height;
  VENEER_ASSIGN(drawing.evaluation, render::parse_evaluation(evaluation));
  VENEER_TRY(drawing.check());
  if (out.extension() != ".png" && out.extension() != ".exr") {
    return fail(
        Errc::kInvalidOption, "writing {}: the name must end in .png or .exr", out.string());
  }

  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(scene_path));
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material, btf::load_material(material_path));
  if (from_eye) {
    seen.view.eye_in_world = {eye[0], eye[1], eye[2]};
    seen.out = out;
    return render_from_eye(scene, *material, seen, line);
  }
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(profile_path));
  options.compensate = !uncompensated;
  VENEER_ASSIGN(const std::unique_ptr<render::Renderer> renderer,
                render::Renderer::create(
                    scene, std::array{render::Level{material.get(), drawing}}, profile, options));
  renderer->draw({Eigen::Vector3d(eye[0], eye[1], eye[2]), scene.world_from_object, 0});
  renderer->finish();
  const int width = profile.geometry.width;
  const int height = profile.geometry.height;
  if (out.extension() == ".exr") {
    Image<Rgb32f> target(width, height);
    renderer->read_target(target.view());
    VENEER_TRY(write_exr(out, target.view(), {"X", "Y", "Z"}));
  } else {
    Image<Rgb16> codes(width, height);
    renderer->read_codes(codes.view());
    // A picture for people: codes of any depth spread over the file's 16 bits.
    const double scale = 65535.0 / ((1U << static_cast<unsigned>(profile.bits)) - 1);
    for (Rgb16& pixel : codes.pixels()) {
      for (std::uint16_t& code : pixel)
        code = static_cast<std::uint16_t>(std::lround(code * scale));
    }
    VENEER_TRY(write_png(out, codes.view()));
  }
  const render::FrameStatistics statistics = renderer->statistics();
  line.print({{"frame", out.string()},
              {"covered_pixels", statistics.covered_pixels},
              {"out_of_gamut_pixels", statistics.out_of_gamut_pixels},
              {"out_of_reach_pixels", statistics.out_of_reach_pixels}},
             fmt::format("wrote {}: {} pixels covered, {} out of gamut",
                         out.string(),
                         statistics.covered_pixels,
                         statistics.out_of_gamut_pixels));
  return kExitDone;
}

}  // namespace veneer::cli
