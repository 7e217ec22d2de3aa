// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <chrono>

#include "base/exit_code.h"
#include "btf/material.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_fit(CommandLine& line) {
  std::filesystem::path set_path;
  std::filesystem::path out;
  std::string model_name;
  btf::FitOptions options;
  std::string names;
  for (const btf::Model& model : btf::models())
    names += fmt::format("\n  {}: {}", model.name, model.summary);
  CLI::App& app = line.app();
  app.add_option("set", set_path, "The sample set, NAME.btfset")->required();
  app.add_option("-o,--output", out, "The material to write, NAME.safetensors")->required();
  app.add_option("--model", model_name, "The model:" + names)->required();
  app.add_option("--clusters", options.clusters, "Clusters of texels")->capture_default_str();
  app.add_option("--components", options.components, "Eigen-BRDFs per texel, such as 4 or 3+1")
      ->capture_default_str();
  app.add_option("--lobes", options.lobes, "Lobes of a texel, for models made of them")
      ->capture_default_str();
  app.add_option(
      "--form", options.form, "How terms are put together; dichromatic-lpca: ratio, subtractive");
  app.add_option("--precision", options.precision, "8bit or float16, for models that offer both");
  app.add_option("--angular", options.angular, "Nodes along each side of the direction square")
      ->capture_default_str();
  app.add_option("--iterations", options.iterations, "Rounds of clustering at most")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();

  VENEER_ASSIGN(const btf::Model* model, btf::find_model(model_name));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(set_path));
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                model->fit(set, options, line.progress()));
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  VENEER_TRY(btf::save_material(*material,
                                out,
                                {{"fitted_on", set.info().source},
                                 {"clusters", std::to_string(options.clusters)},
                                 {"components", options.components},
                                 {"seed", std::to_string(options.seed)}}));
  const btf::ModelShader shader = material->shader();
  line.print({{"material", out.string()},
              {"model", model_name},
              {"seconds", seconds},
              {"gpu_bytes", shader.gpu_bytes()},
              {"fetches", shader.fetches}},
             fmt::format("wrote {}: {} in {:.1f} s, {:.1f} MB on the GPU, {} fetches a pixel",
                         out.string(),
                         model_name,
                         seconds,
                         static_cast<double>(shader.gpu_bytes()) / 1e6,
                         shader.fetches));
  return kExitDone;
}

}  // namespace veneer::cli
