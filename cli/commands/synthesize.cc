// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/synthesize.h"

#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "cli/commands/commands.h"
#include "simulation/materials/phong_texture.h"
#include "simulation/materials/ring_directions.h"

namespace veneer::cli {
namespace {

constexpr std::string_view kPhong = "phong";  // by formula; all others are traced

}  // namespace

Result<int> run_synthesize(CommandLine& line) {
  std::string name;
  std::filesystem::path out;
  int views = 81;
  int lights = 81;
  simulation::SynthesisOptions options;
  std::string names;
  for (const simulation::BodyMaterial& material : simulation::body_materials())
    names += fmt::format("{}, ", material.name);
  for (const simulation::HeightFieldMaterial& material : simulation::height_field_materials())
    names += fmt::format("{}, ", material.name);
  names += kPhong;
  line.app().add_option("material", name, "One of " + names)->required();
  line.app().add_option("-o,--output", out, "The sample set to write, NAME.btfset")->required();
  line.app().add_option("--views", views, "Directions of view")->capture_default_str();
  line.app().add_option("--lights", lights, "Directions of light")->capture_default_str();
  line.app().add_option("--size", options.size, "Texels along each side")->capture_default_str();
  line.app()
      .add_option("--samples", options.samples, "Paths per texel and view; not phong")
      ->capture_default_str();
  line.app()
      .add_option(
          "--bounces", options.bounces, "Reflections between parts of the surface; not phong")
      ->capture_default_str();
  line.app().add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();

  VENEER_ASSIGN(options.views, simulation::ring_directions(views));
  VENEER_ASSIGN(options.lights, simulation::ring_directions(lights));
  if (name == kPhong) {
    VENEER_TRY(simulation::synthesize_phong(out, options, line.progress()));
  } else if (const simulation::BodyMaterial* bodies = simulation::find_body_material(name)) {
    VENEER_TRY(simulation::synthesize(*bodies, out, options, line.progress()));
  } else {
    VENEER_ASSIGN(const simulation::HeightFieldMaterial* material,
                  simulation::find_height_field_material(name));
    VENEER_TRY(simulation::synthesize(*material, out, options, line.progress()));
  }
  line.print({{"set", out.string()},
              {"material", name},
              {"size", options.size},
              {"views", views},
              {"lights", lights}},
             fmt::format("wrote {}", out.string()));
  return kExitDone;
}

}  // namespace veneer::cli
