// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <array>
#include <charconv>
#include <chrono>
#include <string>
#include <utility>

#include "base/exit_code.h"
#include "base/safetensors.h"
#include "btf/mapped_material.h"
#include "btf/texel_synthesis.h"
#include "cli/commands/commands.h"
#include "cli/picture_size.h"

namespace veneer::cli {
Result<int> run_expand(CommandLine& line) {
  std::filesystem::path path;
  std::filesystem::path out;
  std::string size = "512x512";
  btf::SynthesisOptions options;
  CLI::App& app = line.app();
  app.add_option("material", path, "The material of a small sample, NAME.safetensors")->required();
  app.add_option("-o,--output", out, "The material to write, NAME.safetensors")->required();
  app.add_option("--size", size, "Texels of the tile to make, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--patch", options.patch, "Texels along a side of the patches that it is made of")
      ->capture_default_str();
  app.add_option("--overlap", options.overlap, "Texels by which patches lie over each other")
      ->capture_default_str();
  app.add_flag("--source-wraps",
               options.source_wraps,
               "The sample is a tile itself: patches may reach around its edges");
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();
  VENEER_ASSIGN(const PictureSize sides, parse_size(size));
  options.width = sides.width;
  options.height = sides.height;

  // What it was fitted on, and under which licence, stays true of it.
  VENEER_ASSIGN(const SafetensorsFile file, SafetensorsFile::open(path));
  std::map<std::string, std::string> provenance = file.metadata();
  VENEER_ASSIGN(std::unique_ptr<btf::Material> sample, btf::load_material(path));
  VENEER_TRY(btf::refuse_texel_map(
      *sample, Errc::kInvalidOption, fmt::format("expanding {}", path.string())));
  const auto begin = std::chrono::steady_clock::now();
  const btf::TexelFeatures features = btf::texel_features(*sample);
  VENEER_ASSIGN(btf::TexelMap map, btf::synthesize_texels(features, options, line.progress()));
  const btf::MapQuality quality = btf::quality_of(map, features);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                btf::with_texel_map(std::move(sample), std::move(map)));
  provenance["expanded_from"] = path.string();
  provenance["expanded_patch"] = std::to_string(options.patch);
  provenance["expanded_overlap"] = std::to_string(options.overlap);
  provenance["expanded_seed"] = std::to_string(options.seed);
  VENEER_TRY(btf::save_material(*material, out, provenance));
  const btf::ModelShader shader = material->shader();
  line.print(
      {{"material", out.string()},
       {"model", std::string(material->model())},
       {"width", material->width()},
       {"height", material->height()},
       {"seconds", seconds},
       {"seam_step", quality.seam_step},
       {"tiling_step", quality.tiling_step},
       {"repetition", quality.repetition},
       {"texels_used", quality.texels_used},
       {"gpu_bytes", shader.gpu_bytes()},
       {"fetches", shader.fetches}},
      fmt::format("wrote {}: {} of {} x {} texels out of {} x {} in {:.1f} s\n"
                  "  seams       {:.2f} times a step within the sample; plain repeats {:.2f}\n"
                  "  repetition  {:.2f}; plain repeats 1\n"
                  "  {:.0f} % of the sample's texels shown; {:.1f} MB on the GPU, {} fetches "
                  "a pixel",
                  out.string(),
                  material->model(),
                  material->width(),
                  material->height(),
                  features.width,
                  features.height,
                  seconds,
                  quality.seam_step,
                  quality.tiling_step,
                  quality.repetition,
                  100 * quality.texels_used,
                  static_cast<double>(shader.gpu_bytes()) / 1e6,
                  shader.fetches));
  return kExitDone;
}

}  // namespace veneer::cli
