// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "btf/evaluation.h"
#include "cli/commands/commands.h"

namespace veneer::cli {
namespace {

nlohmann::ordered_json to_json(const btf::ImageError& error) {
  return {{"epsilon_avg", error.epsilon_avg},
          {"epsilon_min", error.epsilon_min},
          {"epsilon_max", error.epsilon_max},
          {"rmse", error.rmse},
          {"texel_min", error.texel_min},
          {"texel_max", error.texel_max}};
}

}  // namespace

Result<int> run_evaluate(CommandLine& line) {
  std::filesystem::path set_path;
  std::filesystem::path material_path;
  line.app().add_option("set", set_path, "The sample set, NAME.btfset")->required();
  line.app().add_option("material", material_path, "The material, NAME.safetensors")->required();
  line.parse();

  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material, btf::load_material(material_path));
  VENEER_ASSIGN(const btf::Evaluation e, btf::evaluate(set, *material, line.progress()));
  line.print({{"model", std::string(material->model())},
              {"encoded", to_json(e.encoded)},
              {"linear", to_json(e.linear)},
              {"drawn_epsilon_avg", e.drawn_epsilon_avg},
              {"psnr_db", e.psnr_db},
              {"de00_mean", e.de00_mean},
              {"de00_p95", e.de00_p95},
              {"bytes_per_texel", e.bytes_per_texel},
              {"fetches", e.fetches}},
             fmt::format("{}\n"
                         "  epsilon  {:.4f} encoded, {:.4f} linear (images from {:.4f} to {:.4f})\n"
                         "  rmse     {:.4f} encoded, {:.4f} linear; PSNR {:.1f} dB\n"
                         "  dE00     {:.2f} mean, {:.2f} at 95 %\n"
                         "  as drawn {:.4f} epsilon encoded; {} fetches, {:.0f} bytes a texel",
                         material->model(),
                         e.encoded.epsilon_avg,
                         e.linear.epsilon_avg,
                         e.encoded.epsilon_min,
                         e.encoded.epsilon_max,
                         e.encoded.rmse,
                         e.linear.rmse,
                         e.psnr_db,
                         e.de00_mean,
                         e.de00_p95,
                         e.drawn_epsilon_avg,
                         e.fetches,
                         e.bytes_per_texel));
  return kExitDone;
}

}  // namespace veneer::cli
